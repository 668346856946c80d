"""Sets of effects that are missing together, ranked by the evidence of their linear responses.

An effect that is looked for alone explains the part of another missing effect too. So the residual
r of a model is compared with all effects at once. Each candidate has a block of responses: a column
per parameter, or one column for a leak or a zone at one of many places, times its prior deviation.
Let A be the columns of a set. If the responses were linear, and the amplitudes normal with the
deviation 1, r would be normal with the covariance v + A A^T, and the set would have the evidence

    2 log E(v) = h (I + G)^-1 h - log det(I + G) - r.r / t v - n / t log v,
    G = A^T A / t v,  h = A^T r / t v

(MacKay, Information Theory, section 28.1): a parameter that does not earn its place costs. Each of
the n / t independent errors has the variance v, which is summed over, from what the true effect
leaves to what the model leaves. The parameters of the model's own effects adapt: the part of a
response that they imitate is taken out of r and A.

All responses are simulated once per model on the screening cells. All sets are then compared by
their Gram matrix, without further simulations. Fronts that lie cells apart are linear on coarsely
smoothed residuals only, so that sets are ranked on both smoothing widths.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth
from scipy.special import logsumexp

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.misfit import counted_cells
from porotwin_diagnosis.data.sample import COARSE_SMOOTHING_WIDTH, SMOOTHING_WIDTH, STRIDE, Sample
from porotwin_diagnosis.model.effect_traits import has_place
from porotwin_diagnosis.model.fit import Fit, effects_at, member_slices
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.place_scan import trials_of, with_strength
from porotwin_diagnosis.search.ranking import member_labels
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import SYSTEMATIC_MISFIT
from porotwin_solver.effects.definition.candidate import Candidate

WIDTHS = (COARSE_SMOOTHING_WIDTH, SMOOTHING_WIDTH)
"""Widths [cells] of the smoothing of the residuals that sets are ranked on."""

TRIED, LARGEST = 8, 300
"""Variances that the evidence is summed over, and groups of as many columns that are compared: the
places of one leak fill many."""

Masks = Sequence[NDArray[np.bool_]]
"""The cells that count for the misfit near a fit, one array (nt, nz', nx') per recording."""

Group = tuple[Candidate, ...]
"""Effects, each with a start that the regression gives."""


class Extension(NamedTuple):
    """A set of effects: the `kept` ones of a fit and those `added`; its log evidence if linear."""

    evidence: float
    kept: Fit
    added: Group


@dataclass(frozen=True)
class Block:
    """The columns of one candidate in the matrix of all responses."""

    candidate: Candidate
    columns: tuple[int, ...]


class SetComparison(NamedTuple):
    """The residual of a model and the responses of all candidates, on one smoothing width.

    Attributes:
        gram: A^T A of all columns A, (k, k).
        moments: A^T r, (k,).
        square: r.r, which the model's own parameters leave.
        cells: number n of cells that count (`data.misfit`).
        correlated: cells t that share one error.
    """

    gram: FloatArray
    moments: FloatArray
    square: float
    cells: int
    correlated: float

    @classmethod
    def of(
        cls, residual: FloatArray, own: FloatArray, columns: FloatArray, correlated: float
    ) -> 'SetComparison':
        """Return the comparison of a `residual` (n,) with all `columns` (k, n).

        The part that the model's `own` responses (p, n) imitate is taken out of both.
        """
        if len(own):
            basis = orth(own.T)
            residual = residual - basis @ (basis.T @ residual)
            columns = columns - (columns @ basis) @ basis.T
        square = float(residual @ residual)
        moments = columns @ residual
        return cls(columns @ columns.T, moments, square, len(residual), correlated)


class LinearSets(NamedTuple):
    """All candidates beside the `kept` effects: their blocks, and their comparisons by width."""

    kept: Fit
    blocks: tuple[Block, ...]
    comparisons: tuple[SetComparison, ...]

    def best(self, further: int, most: int) -> list[Extension]:
        """Return at most `most` sets of the kept and `further` effects per width.

        The largest evidence comes first. Each set of labels is there once, with its best places.
        """
        found: dict[frozenset[str], Extension] = {}
        for comparison in self.comparisons:
            if not comparison.square > 0.0:  # no cell counts, or the own effects leave nothing
                continue
            ranked: dict[frozenset[str], Extension] = {}
            every = [
                one
                for columns, groups in _groups(self, further)
                for one in _largest(comparison, columns, groups)
            ]
            for evidence, blocks, amounts in sorted(every, key=lambda one: -one[0]):
                added = _started(blocks, amounts)
                labels = member_labels((*self.kept.members, *added))
                ranked.setdefault(labels, Extension(evidence, self.kept, added))
                if len(ranked) == most:
                    break
            found = ranked | found
        return [*found.values()]


def linear_sets(levels: Levels, space: SearchSpace, near: Fit) -> list[LinearSets]:
    """Return all candidates of `space` beside the effects of `near`, and beside all but one.

    All responses are taken at `near`, which may have no effects. An effect that is left out is
    taken back by its own responses.

    Raises:
        InputError: the model cannot run with `near`.
    """
    fitter, samples = levels.screening, levels.screening.samples
    blocks, changes, deviations = _blocks(space, samples[0])
    residuals = fitter.residuals(near.effects, SMOOTHING_WIDTH)
    counted = [counted_cells(*pair) for pair in zip(samples, residuals, strict=True)]
    here = _residuals(levels, near.effects, counted)
    steps = _steps(near)
    own = _responses(levels, _moved_fit(near, steps), here, counted)
    every = _responses(levels, [(*near.effects, one) for one in changes], here, counted)
    amounts = near.scaled_parameters / steps
    whole = near, list(range(len(steps)))
    return [
        LinearSets(
            kept,
            blocks,
            tuple(
                SetComparison.of(
                    here[n]
                    + sum(amounts[k] * own[k][n] for k in range(len(own)) if k not in parts),
                    np.array([own[k][n] for k in parts]),
                    deviations[:, None] * np.array([one[n] for one in every]),
                    float(np.mean([correlated_cells(sample, width) for sample in samples])),
                )
                for n, width in enumerate(WIDTHS)
            ),
        )
        for kept, parts in (whole, *each_left_out(levels, near))
    ]


def _blocks(
    space: SearchSpace, sample: Sample
) -> tuple[tuple[Block, ...], list[EffectDescription], FloatArray]:
    """Return the blocks of all candidates, and the effect of each column with its deviation."""
    placed = [trial for name in space.local_effects for trial in _trials(sample, name)]
    blocks: list[Block] = []
    changes: list[tuple[EffectDescription, float]] = []
    for candidate in (*space.candidates, *placed):
        begin = len(changes)
        changes += _changes(candidate)
        blocks.append(Block(candidate, tuple(range(begin, len(changes)))))
    return tuple(blocks), [effect for effect, _ in changes], np.array([d for _, d in changes])


def _moved_fit(fit: Fit, steps: Sequence[float]) -> list[tuple[EffectDescription, ...]]:
    """Return, for each parameter of `fit`, the effects with that parameter moved by its step."""
    moved = fit.scaled_parameters + np.diag(steps)
    return [effects_at(fit.members, scaled) for scaled in moved]


def _steps(fit: Fit) -> list[float]:
    """Return the steps, 1 or -1, of the parameters of `fit`, within their ranges."""
    parameters = [parameter for member in fit.members for parameter in member.parameters]
    return [
        1.0 if scaled + 1.0 <= parameter.range[1] else -1.0
        for parameter, scaled in zip(parameters, fit.scaled_parameters, strict=True)
    ]


def each_left_out(levels: Levels, fit: Fit) -> Iterator[tuple[Fit, list[int]]]:
    """Yield `fit` without one effect, for each, as it is on the screening cells.

    Beside it is where its parameters are in `fit`.
    """
    for index, (_, part) in enumerate(member_slices(fit.members)):
        members = [*fit.members[:index], *fit.members[index + 1 :]]
        parts = [n for n in range(len(fit.scaled_parameters)) if not part.start <= n < part.stop]
        yield levels.screening.evaluate(members, fit.scaled_parameters[parts]), parts


def correlated_cells(sample: Sample, width: float) -> float:
    """Return the cells of a map of `sample`, smoothed over `width`, that share one error.

    Noise of the width g correlates over sqrt(4 pi (w^2 + g^2)) smoothed cells each way.
    """
    return max(1.0, 4.0 * math.pi * (width**2 + sample.noise.correlation**2) / STRIDE**2)


def _responses(
    levels: Levels,
    changes: Sequence[tuple[EffectDescription, ...]],
    here: Sequence[FloatArray],
    counted: Masks,
) -> list[list[FloatArray]]:
    """Return the responses to each of `changes` by width; zero where the model cannot run."""

    def response(effects: tuple[EffectDescription, ...]) -> list[FloatArray]:
        try:
            moved = _residuals(levels, effects, counted)
        except InputError:
            return [np.zeros_like(before) for before in here]
        return [before - after for before, after in zip(here, moved, strict=True)]

    run = map if levels.pool is None else levels.pool.map
    return list(run(response, changes))


def _residuals(
    levels: Levels, effects: Sequence[EffectDescription], counted: Masks
) -> list[FloatArray]:
    """Return the residuals of the cells that count, then of the readings, in a row, by width.

    Raises:
        InputError: the model cannot run with these effects.
    """
    by_width = [levels.screening.residuals(effects, width) for width in WIDTHS]
    readings = [one.ravel() for one in levels.screening.reading_residuals(effects)]
    return [
        np.concatenate(
            [*(one[cells] for one, cells in zip(residuals, counted, strict=True)), *readings]
        )
        for residuals in by_width
    ]


def _trials(sample: Sample, name: str) -> list[Candidate]:
    """Return the trials of an effect at all places; none if the rig cannot have it."""
    try:
        return trials_of(sample, name)
    except InputError:
        return []


def _changes(candidate: Candidate) -> Iterator[tuple[EffectDescription, float]]:
    """Yield the effect with each parameter moved by a step, and the deviation in such steps."""
    if has_place(candidate.effect):
        yield candidate.described(candidate.first), 1.0
        return
    for index, parameter in enumerate(candidate.parameters):
        moved = list(candidate.first)
        step = 1.0 if moved[index] + 1.0 <= parameter.range[1] else -1.0
        moved[index] += step
        yield candidate.described(moved), step * parameter.prior_deviation


def may_act(candidate: Candidate, members: Sequence[Candidate]) -> bool:
    """Return whether `candidate` without a place may act beside `members`.

    An effect is there once, but two wells may have the same effect.
    """
    return all(
        candidate.effect != member.effect or candidate.fixed.get('well') != member.fixed.get('well')
        for member in members
    )


def _groups(
    sets: LinearSets, size: int
) -> Iterator[tuple[NDArray[np.intp], list[tuple[Block, ...]]]]:
    """Yield the groups of `size` blocks that may act together, by their number of columns."""
    alike: dict[int, list[tuple[Block, ...]]] = {}
    for group in combinations(sets.blocks, size):
        others = [block.candidate for block in group if not has_place(block.candidate.effect)]
        if all(may_act(one, [*sets.kept.members, *others[:n]]) for n, one in enumerate(others)):
            alike.setdefault(sum(len(block.columns) for block in group), []).append(group)
    for groups in alike.values():
        yield (
            np.array([[n for block in group for n in block.columns] for group in groups], np.intp),
            groups,
        )


def _largest(
    comparison: SetComparison, columns: NDArray[np.intp], groups: Sequence[tuple[Block, ...]]
) -> list[tuple[float, tuple[Block, ...], FloatArray]]:
    """Return the log evidence, the blocks and the amounts of `groups`, with the largest evidence.

    A leak or a zone that needs the opposite sign is left out: it has a trial of its own.
    """
    each, errors = columns.shape[1], comparison.cells / comparison.correlated
    gram = comparison.gram[columns[:, :, None], columns[:, None, :]]
    moments = comparison.moments[columns]
    logs, amounts = [], []
    for variance in np.geomspace(SYSTEMATIC_MISFIT**2, comparison.square / comparison.cells, TRIED):
        k = comparison.correlated * variance
        squares = gram / k + np.eye(each)
        found = np.linalg.solve(squares, moments[..., None] / k)[..., 0]
        gains = np.sum(found * moments, axis=1) / k - np.linalg.slogdet(squares)[1]
        logs.append(0.5 * (gains - comparison.square / k - errors * math.log(variance)))
        amounts.append(found)
    values = logsumexp(logs, axis=0)
    likeliest = np.stack(amounts)[np.argmax(logs, axis=0), np.arange(len(groups))]
    placed = np.array(
        [[has_place(b.candidate.effect) for b in group for _ in b.columns] for group in groups]
    )
    values[np.any((likeliest <= 0.0) & placed, axis=1)] = -np.inf
    order = np.argsort(-values)[:LARGEST]
    return [(float(values[n]), groups[n], likeliest[n]) for n in order]


def _started(blocks: Sequence[Block], amounts: FloatArray) -> Group:
    """Return the candidates of `blocks` with the starts that the `amounts` give."""
    ends = np.cumsum([len(block.columns) for block in blocks])
    return tuple(
        with_strength(block.candidate, float(part[0]))
        if has_place(block.candidate.effect)
        else _moved(block.candidate, part)
        for block, part in zip(blocks, np.split(amounts, ends[:-1]), strict=True)
    )


def _moved(candidate: Candidate, amounts: FloatArray) -> Candidate:
    """Return `candidate` with a start that is `amounts` deviations further, within its ranges."""
    start = tuple(
        float(np.clip(first + parameter.prior_deviation * amount, *parameter.range))
        for first, amount, parameter in zip(
            candidate.first, amounts, candidate.parameters, strict=True
        )
    )
    return replace(candidate, starts=(start,))
