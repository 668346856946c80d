"""Two effects that are missing together beside a third one, by sparse regression.

An effect that is looked for alone explains the part of another missing effect too. A leak is then
placed wrongly, and the true pair is never fitted. Therefore the residual r beside a base is
regressed on two effects at once. Every effect of the library is a block B of responses: a column
per parameter, or one column for a leak or a zone at one of many places. With the projection Q onto
what the base cannot imitate, two blocks explain

    |Q r|^2 - min over u of |Q r - Q (B1, B2) u|^2.

All responses are simulated once per base on the coarse grid of `place_scan`. All couples are then
compared by their Gram matrix, without further simulations.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.effect_traits import has_place
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.place_scan import (
    Comparison,
    compared,
    perturbed,
    trials_of,
    with_strength,
)
from porotwin_diagnosis.thresholds import PARTNER_GAIN_PER_PARAMETER
from porotwin_solver.effects.definition.candidate import Candidate

RIDGE = 1e-6
"""Weight of the squared coefficients relative to the mean square of the responses: responses that
are nearly equal must not need huge coefficients of opposite sign."""

Couple = tuple[Candidate, Candidate]
"""Two effects, each with a start that the regression gives."""


@dataclass(frozen=True)
class _Block:
    """The columns of one candidate in the matrix of all responses."""

    candidate: Candidate
    columns: NDArray[np.intp]


def promising_couples(
    forwards: Sequence[Forward],
    candidates: Sequence[Candidate],
    local_effects: Sequence[str],
    *,
    beside: Fit,
    most: int,
    pool: Executor | None = None,
) -> list[Couple]:
    """Return at most `most` couples of effects that explain most of a residual together.

    Each couple of labels is there once, with its best places. The gain is reduced by
    `PARTNER_GAIN_PER_PARAMETER` for every column.

    Args:
        forwards: one forward model per recording.
        candidates: effects without a place.
        local_effects: names of effects with a place.
        beside: a fit whose effects are present and may adapt.
        most: number of couples.
        pool: compares the simulations; None for one at a time.

    Raises:
        InputError: no pump ever runs, or the model cannot run with `beside`.
    """
    comparisons = [compared(forward, beside.effects) for forward in forwards]
    sample = comparisons[0].recording.sample
    placed = [trial for name in local_effects for trial in trials_of(sample, name)]
    blocks, changes = _blocks(candidates, placed)
    run = map if pool is None else pool.map

    def response(effects: tuple[EffectDescription, ...]) -> FloatArray:
        return _response(comparisons, effects)

    residual = np.concatenate([part.residual.ravel() for part in comparisons])
    adapting = orth(np.stack(list(run(response, perturbed(beside))), axis=1))
    described = [(*beside.effects, effect) for effect in changes]
    matrix = np.stack(list(run(response, described)), axis=1)
    matrix -= adapting @ (adapting.T @ matrix)
    gram, moments = matrix.T @ matrix, matrix.T @ residual
    best: dict[frozenset[str], tuple[float, Couple]] = {}
    for one, other in combinations(blocks, 2):
        labels = frozenset((one.candidate.label, other.candidate.label))
        if len(labels) < 2 and not has_place(one.candidate.effect):
            continue
        gain, couple = _gain(one, other, gram, moments)
        if gain > best.get(labels, (0.0,))[0]:
            best[labels] = gain, couple
    return [couple for _, couple in sorted(best.values(), key=lambda item: -item[0])[:most]]


def _response(
    comparisons: Sequence[Comparison], effects: tuple[EffectDescription, ...]
) -> FloatArray:
    """Return the response to `effects`, zero where the model cannot run with them."""
    try:
        return np.concatenate([part.response(effects).ravel() for part in comparisons])
    except InputError:
        return np.zeros(sum(part.residual.size for part in comparisons))


def _blocks(
    candidates: Sequence[Candidate], placed: Sequence[Candidate]
) -> tuple[list[_Block], list[EffectDescription]]:
    """Return the blocks of all effects, and the effect whose response each column is.

    An effect without a place has a column per parameter, one step from its first start. An effect
    at a place has one column.
    """
    blocks, changes = [], []
    for candidate in candidates:
        begin = len(changes)
        for index in range(len(candidate.parameters)):
            moved = list(candidate.first)
            moved[index] += 1.0
            changes.append(candidate.described(moved))
        blocks.append(_Block(candidate, np.arange(begin, len(changes))))
    for trial in placed:
        changes.append(trial.described(trial.first))
        blocks.append(_Block(trial, np.array([len(changes) - 1])))
    return blocks, changes


def _gain(
    one: _Block, other: _Block, gram: FloatArray, moments: FloatArray
) -> tuple[float, Couple]:
    """Return the reduced gain of two blocks, and both candidates with the starts that it needs.

    The gain is zero where a leak or a zone would need the opposite sign.
    """
    columns = np.concatenate([one.columns, other.columns])
    square = gram[np.ix_(columns, columns)]
    ridge = RIDGE * max(float(np.trace(square)) / len(columns), 1e-30)
    found = np.linalg.solve(square + ridge * np.eye(len(columns)), moments[columns])
    parts = np.split(found, [len(one.columns)])
    started: list[Candidate] = []
    for block, part in zip((one, other), parts, strict=True):
        if has_place(block.candidate.effect):
            if part[0] <= 0.0:
                return 0.0, (one.candidate, other.candidate)
            started.append(with_strength(block.candidate, float(part[0])))
        else:
            started.append(_moved(block.candidate, part))
    gain = float(found @ moments[columns]) * PARTNER_GAIN_PER_PARAMETER ** len(columns)
    return gain, (started[0], started[1])


def _moved(candidate: Candidate, steps: FloatArray) -> Candidate:
    """Return `candidate` with a start that is `steps` further, within its ranges."""
    start = tuple(
        float(np.clip(first + step, *parameter.range))
        for first, step, parameter in zip(candidate.first, steps, candidate.parameters, strict=True)
    )
    return replace(candidate, starts=(start,))
