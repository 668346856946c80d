"""The blind check: makes recordings with sealed effects, diagnoses them, opens, scores.

The diagnosing process gets the folder of a recording and nothing else. What was put in is written
down before, and its hash published first, so that nobody can say afterwards that it was changed.
A run can be interrupted and goes on where it stopped.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.errors import InputError
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.effect import Effect
from porotwin_validation.blind_cases import BlindCase, draw_case
from porotwin_validation.blind_effects import equal_names
from porotwin_validation.blind_truth import Truth, truth_of

CaseProgress = Callable[[int, int, str], None]
"""Told how many cases are done, of how many, and what happened."""

RESULT = Path('result') / 'report.html'
"""What a diagnosis writes last."""

FIGURES = 'figures.json'
"""Where the truth's own figures of a case lie; a case that has them is done."""

CLEAN = 'clean.nc'
"""The maps of a case without noise, beside its recording."""


@dataclass(frozen=True)
class Score:
    """One case, opened: what it was, what was said, whether that is right.

    `imitated`: it is right only because it shows the camera the same as the truth (`Truth`)."""

    name: str
    kind: str
    truth: tuple[str, ...]
    verdict: str
    confidence: float
    right: bool
    imitated: bool
    both_found: bool | None
    gap_closed: float | None
    parameter_errors: tuple[float, ...]
    intervals_held: int
    distance_m: float | None
    seconds: float | None


def blind_check(
    output: Path | str,
    *,
    cases: int = 20,
    seed: int = 1,
    workers: int = 2,
    progress: CaseProgress = lambda _done, _all, _stage: None,
) -> dict[str, Any]:
    """Make, seal, diagnose, open and score `cases` cases; return the figures that were written.

    `output` receives `seal.json` (the hashes, first of all), one folder per case, `scores.json`
    and `report.md` with the table and the confusion matrix. Cases that are there already are kept;
    `workers` cases are worked on at a time, each in a process: netCDF is not safe in threads.
    """
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    drawn = [draw_case(number, seed) for number in range(cases)]
    _publish_seals(folder, drawn, seed)
    missing = [case for case in drawn if not (folder / case.name / FIGURES).exists()]
    failed = _work_through(folder, missing, workers, cases, progress)
    scores = []
    for case in drawn:
        place = folder / case.name
        if case.name in failed:
            scores.append(failed_score(case))
            continue
        _open(case, place)
        scores.append(score_case(case, place / 'result', Truth.read(place / FIGURES)))
    figures = summary(scores)
    (folder / 'scores.json').write_text(
        json.dumps({'summary': figures, 'cases': [score.__dict__ for score in scores]}, indent=1)
    )
    (folder / 'report.md').write_text(table(scores, figures), encoding='utf-8')
    progress(cases, cases, 'done')
    return figures


def _work_through(
    folder: Path, missing: Sequence[BlindCase], workers: int, cases: int, progress: CaseProgress
) -> set[str]:
    """Make and diagnose the `missing` cases; return those whose diagnosis failed.

    An interrupt ends the cases that are worked on, and leaves the others alone.
    """
    failed = set()
    pool = ProcessPoolExecutor(workers, mp_context=get_context('spawn'))
    try:
        work = {pool.submit(_make_and_diagnose, case, folder / case.name): case for case in missing}
        for done, finished in enumerate(as_completed(work), start=cases - len(missing) + 1):
            name = work[finished].name
            try:
                finished.result()
            except (InputError, subprocess.CalledProcessError):
                failed.add(name)
            progress(done, cases, f'{name} {"failed" if name in failed else "diagnosed"}')
    finally:
        pool.shutdown(cancel_futures=True)
    return failed


def _make_and_diagnose(case: BlindCase, place: Path) -> None:
    if not (place / RESULT).exists():
        make_recording(case, place / 'recording', clean=place / CLEAN)
        _diagnose_apart(place / 'recording', place / 'result', case.withheld)
    truth_of(case, place / 'result', place / CLEAN).write(place / FIGURES)


def make_recording(case: BlindCase, folder: Path, *, clean: Path | None = None) -> None:
    """Make the recording of `case` on the virtual rig, and its maps without noise in `clean`; a
    half-made one is made again."""
    if folder.exists():
        shutil.rmtree(folder)
    make_experiment(
        folder,
        case.rig,
        commanded=case.schedule,
        duration=case.duration,
        photo_interval=case.photo_interval,
        seed=case.seed,
        effects=case.effects,
        noise=MapNoise.drawn(case.seed),
        grid=case.rig.default_grid(case.cell_m),
        truth=clean,
    )


def _truth_text(case: BlindCase) -> str:
    content = {
        'name': case.name,
        'kind': case.kind,
        'right': list(case.right),
        'withheld': list(case.withheld),
        'effects': [effect.model_dump() for effect in case.effects],
        'seed': case.seed,
    }
    return json.dumps(content, sort_keys=True, indent=1)


def _publish_seals(folder: Path, drawn: Sequence[BlindCase], seed: int) -> None:
    seals = {
        case.name: hashlib.sha256(_truth_text(case).encode('utf-8')).hexdigest() for case in drawn
    }
    path = folder / 'seal.json'
    if path.exists():
        known = json.loads(path.read_text(encoding='utf-8'))['sha256']
        changed = [name for name in known.keys() & seals.keys() if known[name] != seals[name]]
        if changed:
            raise InputError(
                f'{path}: {changed[0]} was sealed with another truth; name another folder'
            )
        seals = {**known, **seals}
    path.write_text(json.dumps({'seed': seed, 'sha256': seals}, indent=1), encoding='utf-8')


def _diagnose_apart(recording: Path, result: Path, withheld: Sequence[str]) -> None:
    """Diagnose in a process of its own that is told the folder and what to leave out, no more."""
    command = [
        sys.executable,
        '-m',
        'porotwin_validation.blind_process',
        str(recording),
        str(result),
        '1',
        *withheld,
    ]
    one_thread = {**os.environ, 'OMP_NUM_THREADS': '1', 'NUMBA_NUM_THREADS': '1'}
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=one_thread)


def _open(case: BlindCase, place: Path) -> None:
    (place / 'truth.json').write_text(_truth_text(case), encoding='utf-8')


def score_case(case: BlindCase, result: Path, truth: Truth) -> Score:
    """Return how the diagnosis in `result` compares with the truth of `case`.

    Of a pair the stronger effect is right, or either where they are equal (see `Truth`). Right is
    also another name, where it stands for what shows the camera the same on the virtual rig. The
    share of the gap that is closed is not what the diagnosis says, but recomputed against the
    virtual rig's maps without noise.
    """
    said = json.loads((result / 'diagnosis.json').read_text(encoding='utf-8'))
    verdict = str(said['verdict'])
    both = None
    if case.kind == 'pair':
        both = all(
            not set(equal_names(effect)).isdisjoint(said['combination']) for effect in case.effects
        )
    parameters = _parameters(case, said)
    return Score(
        name=case.name,
        kind=case.kind,
        truth=tuple(effect.name for effect in case.effects) or ('none',),
        verdict=verdict,
        confidence=float(said['confidence']),
        right=verdict in truth.strongest or truth.imitated,
        imitated=truth.imitated,
        both_found=both,
        gap_closed=truth.gap_closed,
        parameter_errors=tuple(error for error, _ in parameters),
        intervals_held=sum(inside for _, inside in parameters),
        distance_m=_distance(case, said),
        seconds=float(said['made_with']['seconds']),
    )


def failed_score(case: BlindCase) -> Score:
    """Return the score of a `case` whose diagnosis ended without a verdict: wrong, unsure."""
    return Score(
        name=case.name,
        kind=case.kind,
        truth=tuple(effect.name for effect in case.effects) or ('none',),
        verdict='failed',
        confidence=0.0,
        right=False,
        imitated=False,
        both_found=False if case.kind == 'pair' else None,
        gap_closed=None,
        parameter_errors=(),
        intervals_held=0,
        distance_m=None,
        seconds=None,
    )


def _parameters(case: BlindCase, said: dict[str, Any]) -> list[tuple[float, bool]]:
    """Return the relative error of every parameter of the effects that were found, and whether
    its interval holds the truth."""
    compared = []
    for effect in case.effects:
        if effect.name not in said['combination']:
            continue
        found = next(row for row in said['effects'] if row['name'] == effect.name)['parameters']
        true = {
            name: value
            for name, value in effect.parameters.items()
            if EFFECTS[effect.name].parameters[name].is_scored
            and name in found
            and not isinstance(value, str)
        }
        for name, value in true.items():
            said_of_it = found[name]
            low, high = said_of_it['low'], said_of_it['high']
            inside = low is not None and low <= value <= high
            value_said = float(said_of_it['value'])
            compared.append((_error(EFFECTS[effect.name], name, true, value_said), inside))
    return compared


def _error(effect: Effect, name: str, true: Mapping[str, float], value: float) -> float:
    """Return the error of `value` relative to the strength of the true parameter `name`.

    The strength is the distance from the neutral value; of a vector, its length.
    """
    truth, parameter = true[name], effect.parameters[name]
    if parameter.is_logarithmic:
        return float(abs(np.log(value / truth)) / abs(np.log(truth)))
    size = abs(truth - parameter.neutral)
    if parameter.vector:
        parts = [part for part, p in effect.parameters.items() if p.vector == parameter.vector]
        size = float(np.linalg.norm([true[part] for part in parts]))
    return abs(value - truth) / max(size, 1e-12)


def _distance(case: BlindCase, said: dict[str, Any]) -> float | None:
    centre = said['where']['centre']
    for effect in case.effects:
        if effect.name == said['verdict'] and 'x' in effect.parameters and centre:
            dx = centre['x_m'] - float(effect.parameters['x'])
            dz = centre['z_m'] - float(effect.parameters['z'])
            return float(np.hypot(dx, dz))
    return None


def summary(scores: Sequence[Score]) -> dict[str, Any]:
    """Return the figures of the check, as shares; None where no case asks for one."""

    def share(chosen: Sequence[Score], right: Callable[[Score], bool]) -> float | None:
        return sum(map(right, chosen)) / len(chosen) if chosen else None

    def of(*kinds: str) -> list[Score]:
        return [score for score in scores if score.kind in kinds]

    def median(values: Sequence[float | None]) -> float | None:
        known = [value for value in values if value is not None]
        return float(np.median(known)) if known else None

    # what an effect of the library equals is not outside it
    strange = [
        score
        for score in of('outside', 'left out')
        if score.verdict == 'unexplained' or not score.right
    ]
    errors = [error for score in scores for error in score.parameter_errors]
    return {
        'cases': len(scores),
        'right': share(scores, lambda score: score.right),
        'imitated': share(scores, lambda score: score.imitated),
        'none_called_a_gap': share(of('none'), lambda score: score.verdict != 'none'),
        'sure_and_wrong_name': share(
            scores,
            lambda s: not s.right and s.confidence >= 0.8 and s.verdict != 'unexplained',
        ),
        'outside_called_unexplained': share(strange, lambda score: score.right),
        'both_of_a_pair': share(of('pair'), lambda score: bool(score.both_found)),
        'gap_closed_median': median([score.gap_closed for score in of('single', 'pair')]),
        'parameter_error_median': median(errors),
        'intervals_that_hold': sum(score.intervals_held for score in scores) / max(len(errors), 1),
        'distance_median_m': median([score.distance_m for score in scores]),
        'seconds_median': median([score.seconds for score in scores]),
        'calibration_error': calibration_error(scores),
    }


def calibration_error(scores: Sequence[Score]) -> float:
    """Return the mean difference of stated and seen probability over bins of confidence."""
    edges = [0.0, 0.5, 0.7, 0.85, 0.95, 1.0]
    total = 0.0
    for low, high in pairwise(edges):
        inside = [s for s in scores if low <= s.confidence < high or s.confidence == high == 1.0]
        if inside:
            stated = np.mean([score.confidence for score in inside])
            seen = np.mean([score.right for score in inside])
            total += len(inside) * abs(float(stated - seen))
    return total / max(len(scores), 1)


def table(scores: Sequence[Score], figures: dict[str, Any]) -> str:
    """Return figures, cases and the confusion matrix as Markdown."""
    lines = ['# Blind check', '', '| figure | value |', '| --- | --- |']
    lines += [
        f'| {name.replace("_", " ")} | {value if value is None else round(value, 3)} |'
        for name, value in figures.items()
    ]
    lines += [
        '',
        '| case | kind | truth | verdict | confidence | right |',
        '|---|---|---|---|---|---|',
    ]
    lines += [
        f'| {s.name} | {s.kind} | {" + ".join(s.truth)} | {s.verdict} | {s.confidence:.2f} '
        f'| {"imitated" if s.imitated else "yes" if s.right else "no"} |'
        for s in scores
    ]
    counts = Counter((' + '.join(s.truth), s.verdict) for s in scores)
    truths, verdicts = (sorted({pair[k] for pair in counts}) for k in (0, 1))
    lines += ['', '## Confusion', '', '| truth \\ verdict | ' + ' | '.join(verdicts) + ' |']
    lines += ['|---' * (len(verdicts) + 1) + '|']
    lines += [
        f'| {truth} | ' + ' | '.join(str(counts[truth, said] or '') for said in verdicts) + ' |'
        for truth in truths
    ]
    return '\n'.join(lines) + '\n'
