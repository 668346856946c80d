"""A search that the evidence leads: a beam over sets of effects, ranked by linear responses.

    nice -n 15 python -m lab.stored.evidence_search FOLDER [--seed 31]

1. Every parameter of every effect, and every trial place, makes one response on coarse cells.
2. If responses were linear, each set would have the evidence of `laplace` with the variance v and
   the shared errors integrated out. All sets of one effect are ranked so.
3. The best are fitted, then polished on fine cells, where their evidence is taken.
4. While the best set leaves more than the prior mean of the variance, sets of two are tried, then
   further effects beside the best one and the best two, with the responses taken anew there.
"""

import argparse
import pickle
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from lab.stored.laplace import (
    SHAPE,
    log_evidence,
    needed_variance,
    numbers_of,
    without_fields,
)
from lab.stored.linear_sets import (
    LinearRecording,
    camera_modes,
    correlated_cells,
    linear_recording,
    prior_deviation,
)
from lab.stored.simulation_store import SimulationStore
from lab.stored.stored_cases import stored_jobs
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.false_cells import without_false_cells
from porotwin_diagnosis.data.misfit import _counted_cells
from porotwin_diagnosis.data.sample import (
    COARSE_SMOOTHING_WIDTH,
    SMOOTHING_WIDTH,
    STRIDE,
    Sample,
)
from porotwin_diagnosis.model.effect_traits import has_place
from porotwin_diagnosis.model.fit import Fit, effects_at, member_slices
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Effects
from porotwin_diagnosis.model.polishing import polished
from porotwin_diagnosis.model.unknown_rates import settled
from porotwin_diagnosis.progress import no_progress
from porotwin_diagnosis.search.joint_scan import may_act
from porotwin_diagnosis.search.levels import Levels, make_levels
from porotwin_diagnosis.search.place_scan import trials_of, with_strength
from porotwin_diagnosis.search.ranking import feasible, score
from porotwin_diagnosis.search.single_effects import SearchSpace, search_space
from porotwin_diagnosis.thresholds import BEAM, SYSTEMATIC_MISFIT, WIDE_BEAM
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.effects.definition.candidate import Candidate

OWN_SETS = 'own_linear.pickle'
"""File with the sets that this search found, and its cost, beside the verdict."""

WIDTHS = (COARSE_SMOOTHING_WIDTH, SMOOTHING_WIDTH)
"""Smoothing of the responses [cells]: fronts that lie cells apart are linear only on the first."""

VARIANCES = np.geomspace(0.01, 1000.0, 16)
"""Variances over which the evidence of a ranking is integrated."""

FRAMES = 2.0
"""Frames that share an error."""

STAGES = ((0, 1), (0, 2), (1, 1), (2, 1))
"""Stages: the number of effects of the set whose responses rank further ones, and how many."""

MOST_PLACED = 1
"""Places of the further effects that are ranked together."""


Change = tuple[Effects, float]
"""Effects with one parameter moved by a step, and its prior deviation, in such steps."""


class Block(NamedTuple):
    """The rows of one candidate in the matrix of all responses."""

    candidate: Candidate
    rows: tuple[int, ...]


Group = tuple[Block, ...]
"""Candidates that are added together."""


class Responses(NamedTuple):
    """Responses of all candidates beside a set, of one prior deviation each.

    Attributes:
        blocks: the candidates.
        matrix: whitened responses (k, n) by smoothing width.
        base: responses (p, n) of the set's own parameters, by smoothing width.
        residual: whitened residual (n,) of the set, by smoothing width.
        modes: modes (q, n) of the camera, by smoothing width.
    """

    blocks: tuple[Block, ...]
    matrix: dict[float, FloatArray]
    base: dict[float, FloatArray]
    residual: dict[float, FloatArray]
    modes: dict[float, FloatArray]


class Searched(NamedTuple):
    """The judged fits of a search, the one without effects first, and their linear responses."""

    fits: tuple[Fit, ...]
    recording: LinearRecording
    simulations: int


def search_by_evidence(
    samples: Sequence[Sample], *, excluded: Collection[str] = (), crew: Crew | None = None
) -> Searched:
    """Search for the sets of effects that explain `samples` of one rig.

    Args:
        samples: the recordings.
        excluded: names of effects to leave out.
        crew: runs the simulations.

    Raises:
        InputError: the model cannot run without effects.
    """
    space = search_space(samples, excluded)
    levels = make_levels(samples, progress=no_progress, crew=crew)
    levels = levels.with_corrected_coarse_cells(()).corrected_at(levels.null())
    none = levels.screening.evaluate((), np.zeros(0))
    bases, here = {0: none}, {0: responses(levels.screening, none, space)}
    judged: list[Fit] = []
    for base, further in STAGES:
        beside = bases[base]
        if base not in here:
            levels = levels.with_corrected_coarse_cells(beside.effects)
            here[base] = responses(levels.screening, beside, space)
        groups = ranked(here[base], levels, beside, further)
        fitted = feasible([_fitted(levels, beside, group) for group in groups])
        found = [polished(levels.judging, fit, levels.refining) for fit in _best(fitted)[:BEAM]]
        found = _best([*feasible(found), *_of_size(judged, base + further)])
        levels = levels.corrected_at(found[0])
        recording = linear_recording(levels, [levels.null(), *found], 1)
        numbers = numbers_of(recording, FRAMES)
        sets = [without_fields(one, recording.fields) for one in recording.sets[1:]]
        order = np.argsort([-log_evidence(one, 1.0, **numbers) for one in sets])
        bases[base + further] = found[order[0]]
        judged += found
        if needed_variance(sets[order[0]], **numbers) <= 1.0:
            break
    fits = [levels.null(), *(fit for size in sorted(bases) for fit in _of_size(judged, size))]
    tried = {(c.effect, c.fixed.get('well')) for c in space.candidates}
    singles = len(tried) + len(space.local_effects)
    return Searched(tuple(fits), linear_recording(levels, fits, singles), levels.simulations)


def _of_size(fits: Sequence[Fit], size: int) -> list[Fit]:
    """Return the best fits with `size` effects."""
    return _best(fit for fit in fits if fit.members and len(fit.members) == size)


def _best(fits: Iterable[Fit]) -> list[Fit]:
    """Return the best fits, each set of labels once."""
    first: dict[frozenset[str], Fit] = {}
    for fit in sorted(fits, key=score):
        first.setdefault(frozenset(member.label for member in fit.members), fit)
    return [*first.values()][:WIDE_BEAM]


def _fitted(levels: Levels, best: Fit, group: Sequence[Candidate]) -> Fit:
    """Return the fit of `group`, which begins with the members of `best`."""
    added = [np.array(member.first) for member in group[len(best.members) :]]
    start = np.concatenate([best.scaled_parameters, *added])
    members = (*best.members, *group[len(best.members) :])
    return levels.screening.fit(
        members, start=start, coarse_steps=2, fine_steps=2, updated_slopes=True
    )


def responses(fitter: Fitter, best: Fit, space: SearchSpace) -> Responses:
    """Return the responses of all candidates in `space` beside the fit `best`."""
    sample = fitter.samples[0]
    placed = [trial for name in space.local_effects for trial in _trials(sample, name)]
    here = _residuals(fitter, best.effects)
    assert here is not None
    counted = _counted_cells(sample, here[SMOOTHING_WIDTH])
    rows: dict[float, list[FloatArray]] = {width: [] for width in WIDTHS}

    def added(changes: Iterable[Change], rows: dict[float, list[FloatArray]]) -> None:
        for effects, deviation in changes:
            moved = _residuals(fitter, effects) or here
            for width in WIDTHS:
                rows[width].append(deviation * (here[width] - moved[width])[counted])

    blocks = []
    for candidate in (*space.candidates, *placed):
        begin = len(rows[SMOOTHING_WIDTH])
        added(_changes(best.effects, candidate), rows)
        blocks.append(Block(candidate, tuple(range(begin, len(rows[SMOOTHING_WIDTH])))))
    base: dict[float, list[FloatArray]] = {width: [] for width in WIDTHS}
    added(_moved(best), base)
    c = np.clip(sample.smoothed_observed, 0.0, 1.0)
    size = int(counted.sum())
    return Responses(
        tuple(blocks),
        {width: np.stack(rows[width]) for width in WIDTHS},
        {width: np.array(base[width]).reshape(-1, size) for width in WIDTHS},
        {width: here[width][counted] for width in WIDTHS},
        {
            width: np.stack(camera_modes(c, sample.weight(width), STRIDE))[:, counted]
            for width in WIDTHS
        },
    )


def _residuals(fitter: Fitter, effects: Effects) -> dict[float, FloatArray] | None:
    """Return the whitened residuals by width; None if the model cannot run."""
    try:
        return {width: fitter.residuals(effects, width)[0] for width in WIDTHS}
    except InputError:
        return None


def _trials(sample: Sample, name: str) -> list[Candidate]:
    """Return the trials of an effect at all places; none if the rig cannot have it."""
    try:
        return trials_of(sample, name)
    except InputError:
        return []


def _changes(present: Effects, candidate: Candidate) -> Iterator[Change]:
    """Yield the effects `present` with each parameter of `candidate` moved by a step."""
    if has_place(candidate.effect):
        yield (*present, candidate.described(candidate.first)), 1.0
        return
    for index, parameter in enumerate(candidate.parameters):
        moved = list(candidate.first)
        moved[index] += 1.0 if moved[index] + 1.0 <= parameter.range[1] else -1.0
        step = moved[index] - candidate.first[index]
        yield (*present, candidate.described(moved)), step * prior_deviation(parameter)


def _moved(best: Fit) -> Iterator[Change]:
    """Yield the effects of `best` with each of its parameters moved by a step."""
    for member, part in member_slices(best.members):
        for offset, parameter in enumerate(member.parameters):
            index = part.start + offset
            scaled = best.scaled_parameters.copy()
            step = 1.0 if scaled[index] + 1.0 <= parameter.range[1] else -1.0
            scaled[index] += step
            yield effects_at(best.members, scaled), step * prior_deviation(parameter)


def ranked(here: Responses, levels: Levels, best: Fit, count: int) -> list[tuple[Candidate, ...]]:
    """Return the sets of `count` further effects with the largest evidence if all were linear.

    Every candidate starts where the regression puts it. Each set of labels is there once per width.
    """
    found: dict[tuple[float, frozenset[str]], tuple[Candidate, ...]] = {}
    sample = levels.screening.samples[0]
    for width in WIDTHS:
        correlated = FRAMES * correlated_cells(sample, width)
        variance = float(np.mean(sample.expected_noise_squares)) + SYSTEMATIC_MISFIT**2
        each = [
            (value, blocks, amounts)
            for columns, groups in _groups(here.blocks, best.members, count)
            for value, blocks, amounts in _linear_evidences(
                here, width, columns, groups, correlated, variance
            )
        ]
        first: dict[frozenset[str], tuple[Candidate, ...]] = {}
        for _value, blocks, amounts in sorted(each, key=lambda one: -one[0]):
            labels = frozenset(block.candidate.label for block in blocks)
            first.setdefault(labels, _started(blocks, amounts))
            if len(first) == (WIDE_BEAM if count == 1 else BEAM):
                break
        found |= {(width, labels): group for labels, group in first.items()}
    return [(*best.members, *group) for group in found.values()]


def _groups(
    blocks: Sequence[Block], members: Sequence[Candidate], count: int
) -> Iterator[tuple[NDArray[np.intp], list[Group]]]:
    """Yield arrays of rows (groups, rows of each) with their blocks, by number of rows."""
    by_rows: dict[int, list[Group]] = {}
    for group in combinations(blocks, count):
        placed = sum(has_place(block.candidate.effect) for block in group)
        others = [block.candidate for block in group if not has_place(block.candidate.effect)]
        if placed > MOST_PLACED or not all(
            may_act(one, [*members, *others[:n]]) for n, one in enumerate(others)
        ):
            continue
        by_rows.setdefault(sum(len(block.rows) for block in group), []).append(group)
    for groups in by_rows.values():
        yield np.array([[row for block in group for row in block.rows] for group in groups]), groups


def _linear_evidences(
    here: Responses,
    width: float,
    rows: NDArray[np.intp],
    groups: Sequence[Group],
    correlated: float,
    variance: float,
) -> list[tuple[float, Group, FloatArray]]:
    """Return the log evidence of each of `groups` if responses were linear, and its amounts."""
    r, matrix = here.residual[width], here.matrix[width]
    modes = np.concatenate([here.modes[width], here.base[width]])
    inner = modes @ modes.T
    cross, shown = modes @ matrix.T, modes @ r
    gram, moments, square = matrix @ matrix.T, matrix @ r, float(r @ r)
    each = rows.shape[1]
    placed = np.array([[has_place(b.candidate.effect) for b in g for _ in b.rows] for g in groups])
    logs, steps = [], []
    for v in VARIANCES:
        k = correlated * v
        known = np.linalg.solve(k * np.eye(len(modes)) + inner, np.column_stack([cross, shown]))
        g = (gram - cross.T @ known[:, :-1]) / k
        h = (moments - cross.T @ known[:, -1]) / k
        s = (square - shown @ known[:, -1]) / k
        a = g[rows[:, :, None], rows[:, None, :]] + np.eye(each)
        amounts = np.linalg.solve(a, h[rows][..., None])[..., 0]
        gain = 0.5 * np.sum(amounts * h[rows], axis=1) - 0.5 * np.linalg.slogdet(a)[1]
        determinant = np.linalg.slogdet(np.eye(len(modes)) + inner / k)[1]
        prior = -SHAPE * np.log(v) - (SHAPE - 1.0) * variance / v
        logs.append(gain - 0.5 * (s + determinant + len(r) / correlated * np.log(v)) + prior)
        steps.append(amounts)
    table = np.stack(logs)
    likeliest = np.argmax(table, axis=0)
    amounts = np.stack(steps)[likeliest, np.arange(len(groups))]
    values = logsumexp(table, axis=0) - len(groups[0]) * np.log(len(here.blocks))
    values[np.any((amounts <= 0.0) & placed, axis=1)] = -np.inf  # the other trial has this sign
    keep = np.argsort(-values)[: 20 * WIDE_BEAM]
    return [(float(values[n]), groups[n], amounts[n]) for n in keep]


def _started(blocks: Sequence[Block], amounts: FloatArray) -> tuple[Candidate, ...]:
    """Return the candidates of `blocks` with the starts that the `amounts` give."""
    found, begin = [], 0
    for block in blocks:
        part = amounts[begin : begin + len(block.rows)]
        begin += len(block.rows)
        candidate = block.candidate
        if has_place(candidate.effect):
            found.append(with_strength(candidate, float(part[0])))
            continue
        start = [
            float(np.clip(first + prior_deviation(parameter) * amount, *parameter.range))
            for first, amount, parameter in zip(
                candidate.first, part, candidate.parameters, strict=True
            )
        ]
        found.append(replace(candidate, starts=(tuple(start),)))
    return tuple(found)


def main() -> None:
    """Search the stored recordings anew, and store the sets and the cost."""
    parser = argparse.ArgumentParser(prog='python -m lab.stored.evidence_search')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--seed', type=int, default=31, help='seed of the stored recordings')
    given = parser.parse_args()
    folder = given.folder.resolve()
    count = max((int(path.name[-3:]) for path in folder.glob('case_*')), default=-1) + 1
    for job in stored_jobs(folder, count, given.seed):
        file = job.file.with_name(OWN_SETS)
        if not job.file.exists() or file.exists():
            continue
        begin = time.process_time()
        store = SimulationStore(job.file.parent / 'own_simulations')
        recording = without_false_cells(open_recording(job.file.parent / 'recording'))
        samples = settled([recording], crew=store).samples
        found = search_by_evidence(samples, excluded=job.case.withheld, crew=store)
        seconds = time.process_time() - begin
        file.write_bytes(pickle.dumps((found.recording, store.made, seconds)))
        print(job.case.name, job.case.kind, store.made, f'{seconds:.0f} CPU s', flush=True)


if __name__ == '__main__':
    main()
