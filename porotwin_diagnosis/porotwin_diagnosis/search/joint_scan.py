"""Effects that are missing together, by sparse regression: two beside a base, or three.

An effect that is looked for alone explains the part of another missing effect too. A leak is then
placed wrongly, and the true pair is never fitted. Therefore the residual r beside a base is
regressed on two effects at once, and that of the model without effects on three. Every effect of
the library is a block B of responses: a column per parameter, or one column for a leak or a zone at
one of many places. With the projection Q onto what the base cannot imitate, two blocks explain

    |Q r|^2 - min over u of |Q r - Q (B1, B2) u|^2.

All responses are simulated once per base on the coarse grid of `place_scan`. All groups are then
compared by their Gram matrix, without further simulations.
"""

from collections.abc import Iterator, Sequence
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
    ScanComparison,
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

Group = tuple[Candidate, ...]
"""Effects, each with a start that the regression gives."""

MOST_PLACED = {2: 2, 3: 1}
"""Largest number of leaks and zones in a group, by its size. Three effects with two places would
take minutes to compare."""


@dataclass(frozen=True)
class _Block:
    """The columns of one candidate in the matrix of all responses."""

    candidate: Candidate
    columns: NDArray[np.intp]


def promising_groups(
    forwards: Sequence[Forward],
    candidates: Sequence[Candidate],
    local_effects: Sequence[str],
    *,
    size: int,
    beside: Fit,
    most: int,
    pool: Executor | None = None,
) -> list[Group]:
    """Return at most `most` groups of `size` effects that explain most of a residual together.

    Each group of labels is there once, with its best places. The gain is reduced by
    `PARTNER_GAIN_PER_PARAMETER` for every column.

    Args:
        forwards: one forward model per recording.
        candidates: effects without a place.
        local_effects: names of effects with a place.
        size: number of effects in a group, a key of `MOST_PLACED`.
        beside: a fit whose effects are present and may adapt; it may have none.
        most: number of groups.
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
    described = [(*beside.effects, effect) for effect in changes]
    matrix = np.stack(list(run(response, described)), axis=1)
    if beside.members:
        adapting = orth(np.stack(list(run(response, perturbed(beside))), axis=1))
        matrix -= adapting @ (adapting.T @ matrix)
    gram, moments = matrix.T @ matrix, matrix.T @ residual
    best: dict[frozenset[str], tuple[float, Group]] = {}
    for chosen in _groups(blocks, size):
        gain, group = _gain(chosen, gram, moments)
        labels = frozenset(block.candidate.label for block in chosen)
        if gain > best.get(labels, (0.0,))[0]:
            best[labels] = gain, group
    return [group for _, group in sorted(best.values(), key=lambda item: -item[0])[:most]]


def _groups(blocks: Sequence[_Block], size: int) -> Iterator[tuple[_Block, ...]]:
    """Yield the groups of blocks that may act together, with at most `MOST_PLACED` places.

    An effect is there once, but it may have two wells or two places.
    """
    local = [block for block in blocks if has_place(block.candidate.effect)]
    everywhere = [block for block in blocks if not has_place(block.candidate.effect)]
    for count in range(MOST_PLACED[size] + 1):
        for others in combinations(everywhere, size - count):
            members = [block.candidate for block in others]
            apart = (may_act(one, members[:n]) for n, one in enumerate(members))
            if all(apart):
                yield from ((*others, *places) for places in combinations(local, count))


def may_act(candidate: Candidate, members: Sequence[Candidate]) -> bool:
    """Return whether `candidate` without a place may act beside `members`.

    An effect is there once, but two wells may have the same effect.
    """
    return all(
        candidate.effect != member.effect or candidate.fixed.get('well') != member.fixed.get('well')
        for member in members
    )


def _response(
    comparisons: Sequence[ScanComparison], effects: tuple[EffectDescription, ...]
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
    blocks: list[_Block] = []
    changes: list[EffectDescription] = []
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


def _gain(blocks: Sequence[_Block], gram: FloatArray, moments: FloatArray) -> tuple[float, Group]:
    """Return the reduced gain of `blocks`, and the candidates with the starts that it needs.

    The gain is zero where a leak or a zone would need the opposite sign.
    """
    columns = np.concatenate([block.columns for block in blocks])
    square = gram[np.ix_(columns, columns)]
    ridge = RIDGE * max(float(np.trace(square)) / len(columns), 1e-30)
    found = np.linalg.solve(square + ridge * np.eye(len(columns)), moments[columns])
    parts = np.split(found, np.cumsum([len(block.columns) for block in blocks])[:-1])
    gain = float(found @ moments[columns]) * PARTNER_GAIN_PER_PARAMETER ** len(columns)
    started: list[Candidate] = []
    for block, part in zip(blocks, parts, strict=True):
        if not has_place(block.candidate.effect):
            started.append(_moved(block.candidate, part))
        elif part[0] > 0.0:
            started.append(with_strength(block.candidate, float(part[0])))
        else:
            return 0.0, ()
    return gain, tuple(started)


def _moved(candidate: Candidate, steps: FloatArray) -> Candidate:
    """Return `candidate` with a start that is `steps` further, within its ranges."""
    start = tuple(
        float(np.clip(first + step, *parameter.range))
        for first, step, parameter in zip(candidate.first, steps, candidate.parameters, strict=True)
    )
    return replace(candidate, starts=(start,))
