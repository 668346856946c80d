"""The progress of a case: written by its worker, read by the check."""

from pathlib import Path

import pytest

from lab.blind import case_progress
from lab.blind.case_progress import FILE, CaseProgress, part_of, share_done


def test_the_share_of_a_case_is_told_while_it_is_in_work(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ('a', 'b', 'c')]
    with CaseProgress(folders[0]) as first, CaseProgress(folders[1]) as second:
        first(0.25)
        second(0.5)
        assert [share_done(folder) for folder in folders] == pytest.approx([0.25, 0.5, 0.0])
        (folders[1] / FILE).write_text('half')
        assert [share_done(folder) for folder in folders] == pytest.approx([0.25, 0.0, 0.0])
    assert [share_done(folder) for folder in folders] == [0.0, 0.0, 0.0]
    assert not list(tmp_path.rglob('*.*'))


def test_thousands_of_steps_write_few_files(tmp_path: Path, monkeypatch) -> None:
    now = 100.0
    monkeypatch.setattr(case_progress.time, 'monotonic', lambda: now)
    with CaseProgress(tmp_path) as progress:
        progress(0.1)
        progress(0.2)
        assert share_done(tmp_path) == pytest.approx(0.1)
        now += 2.0
        progress(0.3)
        assert share_done(tmp_path) == pytest.approx(0.3)


def test_a_part_fills_its_share_of_the_work() -> None:
    told: list[float] = []
    part = part_of(told.append, 0.3, 0.9)
    for share in (0.0, 0.5, 1.0, 1.2):
        part(share)
    assert told == pytest.approx([0.3, 0.6, 0.9, 0.9])
