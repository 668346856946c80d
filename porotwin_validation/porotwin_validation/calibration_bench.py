"""The calibration of a camera on photographs with known truth: its maps, and what it refuses.

Cases are composed on a real baseline and scored one after the other. Each is safe if its maps are
accurate or its calibration is refused. A calibration that was made well must not be refused.
"""

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_core.parallel import Crew, crew
from porotwin_validation.photo_cases import baseline_of, draw_case, write_case
from porotwin_validation.photo_flaws import WITHHELD_KIND
from porotwin_validation.photo_scores import PhotoCaseScore, score_case

CASE_BYTES = 1.5e9
"""Memory of a case [B]: a photograph of some megapixels in several colour spaces."""


def run(
    baseline: Path | None = None,
    cases: int = len(WITHHELD_KIND),
    seed: int = 1,
    flaw: str | None = None,
    workers: int | None = None,
    scheduler: str = '',
    tell: Callable[[str], None] = lambda _: None,
) -> list[dict[str, object]]:
    """Return one row per case, and the share of safe cases in a last row.

    Args:
        baseline: experiment folder with a real baseline photograph and sands.
        cases: number of cases.
        seed: seed of the cases.
        flaw: the same flaw in all cases; None for those of `photo_flaws.WITHHELD_KIND`.
        workers: cases at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler that does the cases instead of this machine.
        tell: called with a line about the workers.

    Raises:
        InputError: there is no baseline, or the flaw is not known.
    """
    if baseline is None:
        raise InputError(
            'bench calibration: needs --baseline FOLDER, an experiment folder with a photograph '
            'of the rig without tracer'
        )
    make_crew = partial(
        crew, workers=workers, scheduler=scheduler, task_bytes=CASE_BYTES, tell=tell
    )
    scores = list(_scores(baseline.resolve(), cases, seed, flaw, make_crew))
    return [*(score.row for score in scores), _summary(scores)]


def _scores(
    folder: Path, cases: int, seed: int, flaw: str | None, make_crew: Callable[[], Crew]
) -> Iterator[PhotoCaseScore]:
    with make_crew() as pool:
        pool.needs_folder(folder)
        yield from pool.map(partial(_score, folder, seed, flaw), range(cases))


def _score(folder: Path, seed: int, flaw: str | None, number: int) -> PhotoCaseScore:
    """Compose the case `number` on the baseline in `folder`, and score it."""
    rig, pixels = baseline_of(folder)
    with tempfile.TemporaryDirectory(prefix='porotwin_bench_') as output:
        case = draw_case(rig, number, seed, flaw)
        return score_case(write_case(case, pixels, Path(output)))


def _summary(scores: list[PhotoCaseScore]) -> dict[str, object]:
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
