"""The runner of studies: it continues a folder, and reads what its jobs have left."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest

from lab import study
from lab.study import FiguresJob, Study, study_folder
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import ThreadCrew


@dataclass(frozen=True)
class Ratio:
    """The figures of a test."""

    value: float
    pairs: dict[str, tuple[int, float]]


@dataclass(frozen=True)
class HalfJob(FiguresJob[Ratio]):
    """Halves a number."""

    number: float
    file: Path
    kind: ClassVar = Ratio

    def figures(self) -> Ratio:
        """Return half of the number."""
        return Ratio(self.number / 2.0, {'half': (1, self.number / 2.0)})


def test_a_study_does_what_is_missing_and_keeps_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, 'crew', lambda **_: ThreadCrew(1))  # a process takes seconds
    jobs = [HalfJob(number, tmp_path / f'{number:g}.json') for number in (1.0, math.nan)]
    jobs[0].file.write_text('{"value": 7.0, "pairs": {}}')
    Study(tmp_path, 1e6, workers=1).do(jobs, seconds_per_job=1.0)
    assert jobs[0].found() == Ratio(7.0, {})
    assert math.isnan(jobs[1].found().value)
    assert math.isnan(jobs[1].found().pairs['half'][1])


def test_a_folder_with_an_earlier_part_is_continued_and_another_one_is_refused(
    tmp_path: Path,
) -> None:
    def holds(path: Path) -> bool:
        return (path / '1.json').exists()

    assert study_folder(tmp_path / 'new', 'bench', holds) == tmp_path / 'new'
    (tmp_path / 'new' / '1.json').touch()
    assert study_folder(tmp_path / 'new', 'bench', holds) == tmp_path / 'new'
    (tmp_path / 'other').mkdir()
    (tmp_path / 'other' / 'note.txt').touch()
    with pytest.raises(InputError, match='exists already'):
        study_folder(tmp_path / 'other', 'bench', holds)
