"""The calibration of a camera on photographs with known truth: its maps and its refusals.

Cases are composed on a real baseline and scored. Each is safe if its maps are accurate or its
calibration is refused. A calibration that was made well must not be refused. A case leaves one
file, so that an interrupted bench goes on where it stopped.
"""

import json
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from porotwin_cli.bench_jobs import do_jobs
from porotwin_cli.workspace import continued_folder
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.whole_file import write_whole
from porotwin_validation.photo_cases import baseline_of, draw_case, write_case
from porotwin_validation.photo_flaws import WITHHELD_KIND
from porotwin_validation.photo_scores import MapScore, PhotoCaseScore, score_case

CASE_BYTES = 1.5e9
"""Memory of a case [B]: a photograph of some megapixels in several colour spaces."""
SECONDS_PER_CASE = 45.0
"""A case on one core [s]."""


@dataclass(frozen=True)
class CalibrationCase:
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

    def work(self) -> None:
        """Compose the case, score it, and write its file."""
        rig, pixels = baseline_of(self.baseline)
        with tempfile.TemporaryDirectory(prefix='porotwin_bench_') as output:
            case = draw_case(rig, self.number, self.seed, self.flaw)
            score = score_case(write_case(case, pixels, Path(output)))
        write_whole(self.file, json.dumps(asdict(score)))


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
    folder = continued_folder(output, 'bench-calibration', 'case_*.json')
    kind = f'_{flaw.replace(" ", "_").replace("/", "by")}' if flaw else ''
    jobs = [
        CalibrationCase(
            baseline.resolve(), seed, number, flaw, folder / f'case_{seed}_{number:03d}{kind}.json'
        )
        for number in range(cases)
    ]
    do_jobs(
        jobs,
        task_bytes=CASE_BYTES,
        seconds_per_job=SECONDS_PER_CASE,
        workers=workers,
        scheduler=scheduler,
    )
    scores = [_read(job.file) for job in jobs]
    return [*(score.row for score in scores), summary(scores)]


def _read(file: Path) -> PhotoCaseScore:
    """Return the score that a case has left."""
    found: dict[str, Any] = json.loads(file.read_text(encoding='utf-8'))
    maps = found.pop('maps')
    if maps is not None:
        maps = MapScore(tuple(maps['errors']), maps['bias'])
    return PhotoCaseScore(**{**found, 'maps': maps, 'lines': tuple(found['lines'])})


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
