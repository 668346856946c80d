"""The calibration of a camera on photographs with known truth: its maps and its refusals.

Cases are composed on a real baseline and scored. Each is safe if its maps are accurate or its
calibration is refused. A calibration that was made well must not be refused. A case leaves one
file, so that an interrupted bench goes on where it stopped.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from lab.photographs.photo_cases import baseline_of, draw_case, write_case
from lab.photographs.photo_flaws import WITHHELD_KIND
from lab.photographs.photo_scores import PhotoCaseScore, score_case
from lab.study import FiguresJob, Study, study_folder
from porotwin_core.basis.errors import InputError

CASE_BYTES = 1.5e9
"""Memory of a case [B]: a photograph of some megapixels in several colour spaces."""
SECONDS_PER_CASE = 45.0
"""A case on one core [s]."""


@dataclass(frozen=True)
class CalibrationCase(FiguresJob[PhotoCaseScore]):
    """One case of the bench.

    Attributes:
        baseline: experiment folder with a real baseline photograph and sands.
        seed: seed of the cases.
        number: number of the case.
        flaw: its flaw; None for `photo_flaws.WITHHELD_KIND`.
        file: the file with its score.
    """

    baseline: Path
    seed: int
    number: int
    flaw: str | None
    file: Path
    kind: ClassVar = PhotoCaseScore

    def figures(self) -> PhotoCaseScore:
        """Compose the case and return its score."""
        rig, pixels = baseline_of(self.baseline)
        with tempfile.TemporaryDirectory(prefix='porotwin_bench_') as output:
            case = draw_case(rig, self.number, self.seed, self.flaw)
            return score_case(write_case(case, pixels, Path(output)))


def run(
    baseline: Path | None = None,
    cases: int = len(WITHHELD_KIND),
    seed: int = 1,
    *,
    flaw: str | None = None,
    workers: int | None = None,
    scheduler: str = '',
    output: Path | None = None,
) -> list[dict[str, object]]:
    """Return one row per case, and the share of safe cases in a last row.

    Args:
        baseline: experiment folder with a real baseline photograph and sands.
        cases: number of cases.
        seed: seed of the cases.
        flaw: the same flaw in all cases; None for the flaws of `photo_flaws.WITHHELD_KIND`.
        workers: cases at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler that does the cases instead of this machine.
        output: folder of the scores; one with earlier scores is continued.

    Raises:
        InputError: there is no baseline, the flaw is not known, or the folder cannot be used.
    """
    if baseline is None:
        raise InputError(
            'bench calibration: needs --baseline FOLDER, an experiment folder with a photograph '
            'of the rig without tracer'
        )
    folder = study_folder(output, 'bench-calibration', lambda path: any(path.glob('case_*.json')))
    kind = f'_{flaw.replace(" ", "_").replace("/", "by")}' if flaw else ''
    jobs = [
        CalibrationCase(
            baseline.resolve(), seed, number, flaw, folder / f'case_{seed}_{number:03d}{kind}.json'
        )
        for number in range(cases)
    ]
    Study(folder, CASE_BYTES, workers, scheduler).do(jobs, seconds_per_job=SECONDS_PER_CASE)
    scores = [job.found() for job in jobs]
    return [*(score.row for score in scores), summary(scores)]


def summary(scores: list[PhotoCaseScore]) -> dict[str, object]:
    """Return the last row: how many cases are safe, and how many good ones were refused."""
    good = [score for score in scores if score.expected == 'use']
    refused = sum(score.maps is None for score in good)
    row: dict[str, object] = dict.fromkeys(scores[0].row, '')
    safe = sum(score.safe for score in scores)
    return {
        **row,
        'case': 'all',
        'answer': f'{refused} of {len(good)} good ones refused',
        'safe': f'{safe} of {len(scores)}',
    }
