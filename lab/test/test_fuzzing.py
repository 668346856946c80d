"""Damaged files for the readers."""

import os
import time
from pathlib import Path

import pytest

from lab.faults.fuzzing import READERS, Reader, ReadFn, damaged, fuzz, read_damaged


def test_a_damage_follows_from_its_seed() -> None:
    data = b'time_s,well\n0,injector\n' * 10
    assert damaged(data, 3) == damaged(data, 3)
    assert len({damaged(data, seed) for seed in range(20)}) > 15


def test_an_empty_file_can_be_damaged() -> None:
    assert all(isinstance(damaged(b'', seed), bytes) for seed in range(50))


@pytest.mark.parametrize('name', [name for name in READERS if 'bag' not in name])
def test_damaged_files_are_read_or_refused_with_one_line(name: str) -> None:
    outcome = read_damaged(READERS[name], range(20))
    assert outcome.faults == []
    assert outcome.read + outcome.refused == 20


@pytest.mark.parametrize('name', READERS)
def test_a_whole_file_is_read(name: str, tmp_path: Path) -> None:
    reader = READERS[name]
    reader.make(tmp_path)
    reader.read(tmp_path / reader.name)


def _write(folder: Path) -> None:
    (folder / 'file').write_text('text')


def _hang(_: Path) -> None:
    time.sleep(3600.0)


def _crash(_: Path) -> None:
    os.abort()


@pytest.mark.parametrize('read', [_hang, _crash])
def test_a_reader_that_hangs_or_crashes_is_ended_and_told(read: ReadFn) -> None:
    outcome = fuzz(Reader('file', _write, read), tries=2, seed=7, longest_s=1)
    assert [fault.split(':')[0] for fault in outcome.faults] == ['seed 7', 'seed 8']
