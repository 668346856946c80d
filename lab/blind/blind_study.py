"""The blind check: recordings with hidden effects are made, diagnosed and scored.

Recordings hold disturbed maps, or photographs that were calibrated and imaged before the diagnosis.
The diagnosing process knows the folder of a recording and the effects to leave out, nothing else.
The truths are hashed and the hashes published before the first diagnosis. An interrupted check
continues where it stopped.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lab.blind.blind_cases import BlindCase, draw_case
from lab.blind.blind_hashes import Source, open_truth, publish_hashes
from lab.blind.blind_limit import truth_is_visible
from lab.blind.blind_photographs import MAPS, RECORDING, REFUSED, photograph_case
from lab.blind.blind_score import CaseScore, failed_score, score_case
from lab.blind.blind_table import summary, table
from lab.blind.blind_truth import CaseTruth, truth_of
from lab.blind.calibration_absorption import MapFigures, absorption_table, map_figures
from lab.blind.case_progress import CaseProgress, Share, no_share, part_of, share_done
from lab.photographs.photo_cases import baseline_of
from lab.study import Study, StudyJob, missing_jobs, work_through
from porotwin_core.basis.errors import InputError, refuse_file
from porotwin_core.basis.parent import PARENT
from porotwin_diagnosis.report.report_folder import REPORT
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_rig.virtual_rig import VirtualRig

CheckProgress = Callable[[float, int, str], None]
"""Called with the cases that are done, parts of cases included, the number of all cases, and the
event."""

Work = Callable[[BlindCase, Path], None]
"""Makes and diagnoses a case in its folder."""

COMPARISON = 'figures.json'
"""File with the comparison of a diagnosis and its truth; a case that has it is done."""

MAP_FIGURES = 'maps.json'
"""File with the figures of maps from photographs."""

CASE_BYTES = 1.5e9
"""Memory of a case, most of it in the process that diagnoses [B]."""

FAILURES = (InputError, subprocess.CalledProcessError)
"""Errors of one case that do not stop the others."""

MADE_SHARE = 0.3
"""Share of the work on a case that is done when its recording is made."""

CLEAN_MAPS = 'clean.nc'
"""File with the maps of a case without noise, beside its recording."""


@dataclass(frozen=True)
class CaseJob(StudyJob):
    """A case that `do` makes and diagnoses, in the folder of its file `COMPARISON`."""

    case: BlindCase
    file: Path
    do: Work
    did: ClassVar = 'diagnosed'

    @property
    def name(self) -> str:
        """The name of the case."""
        return self.case.name

    def work(self) -> None:
        """Make, diagnose and compare.

        Raises:
            InputError, CalledProcessError: the diagnosis failed.
        """
        self.do(self.case, self.file.parent)

    def share(self) -> float:
        """Return the share of the case that is done."""
        return share_done(self.file.parent)


def ignore_progress(_done: float, _all: int, _event: str) -> None:
    """Ignore the progress."""


def blind_check(
    output: Path | str,
    *,
    cases: int = 20,
    seed: int = 1,
    workers: int | None = None,
    scheduler: str = '',
    tell: Callable[[str], None] = lambda _: None,
    progress: CheckProgress = ignore_progress,
    draw: Callable[..., BlindCase] = draw_case,
    source: Source = 'maps',
    baseline: Path | None = None,
) -> dict[str, Any]:
    """Make, diagnose and score `cases` cases; return the figures of the check.

    Writes into `output`: `truth_hashes.json` first of all, one folder per case, `scores.json`, and
    `report.md` with the table and the confusion matrix. Cases that are done already are kept.

    Args:
        output: folder of the check; it is made if it does not exist.
        cases: number of cases.
        seed: seed of the cases.
        workers: number of cases at a time, each in a process, because netCDF is not thread-safe;
            None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler whose workers do the cases instead.
        tell: called with a line about the workers.
        progress: called after every case, and every two seconds in between.
        draw: returns case `number` of the check with `seed`; with a `baseline` also of its `rig`.
        source: whether maps of the rig are disturbed, or photographs of it become maps.
        baseline: experiment folder with the baseline photograph of a real rig; all photographs are
            composed on it.

    Raises:
        InputError: the folder holds a check with other truths or is a file, `baseline` has no
            photograph, or a worker does not see the folder.
    """
    folder = Path(output).resolve()  # the workers may have another working folder
    refuse_file(folder, 'the cases')
    folder.mkdir(parents=True, exist_ok=True)
    work: Work = make_and_diagnose
    if source == 'photographs':
        work = partial(photograph_and_diagnose, baseline=baseline)
        if baseline is not None:
            draw = partial(draw, rig=baseline_of(baseline)[0])
    drawn = [draw(number, seed) for number in range(cases)]
    publish_hashes(folder, drawn, seed, source)
    missing = missing_jobs([CaseJob(case, folder / case.name / COMPARISON, work) for case in drawn])
    failed: set[str] = set()
    if missing:
        with Study(folder, CASE_BYTES, workers, scheduler, tell).crew() as pool:
            failed = work_through(
                missing,
                pool,
                lambda done, event: progress(cases - len(missing) + done, cases, event),
                forgiven=FAILURES,
            )
    scores = [_score(case, folder / case.name, failed=case.name in failed) for case in drawn]
    figures = summary(scores)
    content = {'summary': figures, 'cases': [asdict(score) for score in scores]}
    (folder / 'scores.json').write_text(json.dumps(content, indent=1), encoding='utf-8')
    report = table(scores, figures)
    if source == 'photographs':
        report += '\n'.join(_photographs(drawn, folder)) + '\n'
    (folder / 'report.md').write_text(report, encoding='utf-8')
    progress(cases, cases, 'done')
    return figures


def make_and_diagnose(case: BlindCase, folder: Path) -> None:
    """Make the recording of `case` in `folder`, diagnose it, and compare it with the truth.

    Raises:
        InputError, CalledProcessError: the diagnosis failed.
    """
    if not (folder / 'result' / REPORT).exists():
        with CaseProgress(folder) as progress:
            made = part_of(progress, 0.0, MADE_SHARE)
            make_recording(case, folder / 'recording', clean=folder / CLEAN_MAPS, progress=made)
            _diagnose_in_own_process(
                folder / 'recording', folder / 'result', case.withheld, progress
            )
    truth_of(case, folder / 'result', folder / CLEAN_MAPS).write(folder / COMPARISON)


def photograph_and_diagnose(case: BlindCase, folder: Path, *, baseline: Path | None = None) -> None:
    """Photograph `case` in `folder`, calibrate, image, diagnose, and compare with the truth.

    Args:
        case: the case.
        folder: its folder.
        baseline: experiment folder with the baseline photograph of a real rig; None renders.

    Raises:
        InputError, CalledProcessError: the calibration was refused, or the diagnosis failed.
    """
    clean = folder / CLEAN_MAPS
    if not (folder / 'result' / REPORT).exists():
        folder.mkdir(parents=True, exist_ok=True)
        with CaseProgress(folder) as progress:
            made = part_of(progress, 0.0, MADE_SHARE)
            photograph_case(case, folder, clean=clean, baseline=baseline, progress=made)
            _diagnose_in_own_process(folder / RECORDING, folder / 'result', case.withheld, progress)
    map_figures(case, folder / RECORDING / MAPS, clean).write(folder / MAP_FIGURES)
    truth_of(case, folder / 'result', clean).write(folder / COMPARISON)


def _photographs(cases: Sequence[BlindCase], folder: Path) -> Iterator[str]:
    """Yield the errors of the maps, and the effects that calibrations absorbed, as Markdown."""
    figures = {
        case.name: MapFigures.read(folder / case.name / MAP_FIGURES)
        for case in cases
        if (folder / case.name / MAP_FIGURES).exists()
    }
    yield from ('', '## Photographs', '')
    if figures:
        errors = [found.error for found in figures.values()]
        yield (
            f'Maps from photographs: relative L2 error {np.median(errors):.1%} in the median, '
            f'{max(errors):.1%} at most.'
        )
        yield ''
        yield from absorption_table(figures.values())
    for case in cases:
        refused = folder / case.name / REFUSED
        if refused.exists():
            yield f'\n{case.name}: {refused.read_text(encoding="utf-8").strip()}'


def make_recording(
    case: BlindCase, folder: Path, *, clean: Path | None = None, progress: Share = no_share
) -> None:
    """Make the recording of `case` on the virtual rig, and its maps without noise in `clean`.

    A folder that exists is an unfinished recording, and is made again. `progress` is called with
    the share of the experiment that is done.

    Raises:
        InputError: an effect of the case is not known or impossible.
    """
    if folder.exists():
        shutil.rmtree(folder)
    make_experiment(
        folder,
        VirtualRig(case.rig, effects=case.effects, cell=case.element_m),
        commanded=case.schedule,
        duration=case.duration,
        photo_interval=case.photo_interval,
        seed=case.seed,
        noise=MapNoise.drawn(case.seed),
        grid=case.rig.default_grid(case.cell_m),
        truth=clean,
        progress=progress,
    )


def _diagnose_in_own_process(
    recording: Path, result: Path, withheld: Sequence[str], progress: Share
) -> None:
    """Diagnose `recording` in a process that knows only its folder and the `withheld` effects."""
    module = 'lab.blind.blind_process'
    command = [sys.executable, '-m', module, str(recording), str(result), *withheld]
    own = {'OMP_NUM_THREADS': '1', 'NUMBA_NUM_THREADS': '1', PARENT: str(os.getpid())}
    diagnosed = part_of(progress, MADE_SHARE, 1.0)
    run_with_shares(command, {**os.environ, **own}, diagnosed)


def run_with_shares(command: Sequence[str], environment: dict[str, str], progress: Share) -> None:
    """Run `command`, whose lines on standard output tell the share of its work that is done.

    Raises:
        CalledProcessError: it failed.
    """
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                with suppress(ValueError):  # a line of a library
                    progress(float(line))
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)


def _score(case: BlindCase, folder: Path, *, failed: bool) -> CaseScore:
    if failed:
        return failed_score(case, 'refused' if (folder / REFUSED).exists() else 'failed')
    open_truth(case, folder)
    hidden: frozenset[str] = frozenset()
    if (folder / MAP_FIGURES).exists():
        hidden = MapFigures.read(folder / MAP_FIGURES).hidden
    result = folder / 'result'
    score = score_case(case, result, CaseTruth.read(folder / COMPARISON), hidden)
    if score.right and score.all_found is not False:
        return score
    visible = truth_is_visible(folder / RECORDING, result, folder / CLEAN_MAPS)
    return replace(score, visible=visible)
