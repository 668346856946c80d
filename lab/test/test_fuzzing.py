"""Damaged files for the readers."""

from pathlib import Path

import pytest

from lab.faults.fuzzing import READERS, damaged, read_damaged


def test_a_damage_follows_from_its_seed() -> None:
    data = b'time_s,well\n0,injector\n' * 10
    assert damaged(data, 3) == damaged(data, 3)
    assert len({damaged(data, seed) for seed in range(20)}) > 15


def test_an_empty_file_can_be_damaged() -> None:
    assert all(isinstance(damaged(b'', seed), bytes) for seed in range(50))


@pytest.mark.parametrize('name', [name for name in READERS if 'bag' not in name])
def test_damaged_files_are_read_or_refused_with_one_line(name: str) -> None:
    outcome = read_damaged(name, range(20))
    assert outcome.faults == []
    assert outcome.read + outcome.refused == 20


@pytest.mark.parametrize('name', READERS)
def test_a_whole_file_is_read(name: str, tmp_path: Path) -> None:
    reader = READERS[name]
    reader.make(tmp_path)
    reader.read(tmp_path / reader.name)
