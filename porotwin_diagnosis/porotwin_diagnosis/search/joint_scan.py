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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
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
are nearly equal must not need huge coefficients of opposite sign. Finite differences are not more
accurate."""

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
    best: dict[frozenset[str], _Explanation] = {}
    for groups in _groups(blocks, size):
        found = _best(groups, gram, moments)
        labels = frozenset(block.candidate.label for block in found.blocks)
        if found.gain > (best[labels].gain if labels in best else 0.0):
            best[labels] = found
    order = sorted(best.values(), key=lambda found: -found.gain)
    return [found.started() for found in order[:most]]


class _Groups(NamedTuple):
    """Groups with the same labels: the blocks `everywhere`, with each of the tuples `placed`."""

    everywhere: tuple[_Block, ...]
    placed: Sequence[tuple[_Block, ...]]
    columns: NDArray[np.intp]
    """The columns of `placed`, (groups, places)."""


class _Explanation(NamedTuple):
    """A group of blocks, its reduced gain, and the amounts of all of its columns."""

    gain: float
    blocks: tuple[_Block, ...]
    amounts: FloatArray

    def started(self) -> Group:
        """Return the candidates with the starts that the amounts give."""
        ends = np.cumsum([len(block.columns) for block in self.blocks])
        parts = zip(self.blocks, np.split(self.amounts, ends[:-1]), strict=True)
        return tuple(
            with_strength(block.candidate, float(part[0]))
            if has_place(block.candidate.effect)
            else _moved(block.candidate, part)
            for block, part in parts
        )


def _groups(blocks: Sequence[_Block], size: int) -> Iterator[_Groups]:
    """Yield the groups of blocks that may act together, with at most `MOST_PLACED` places.

    An effect is there once, but it may have two wells or two places.
    """
    local = [block for block in blocks if has_place(block.candidate.effect)]
    everywhere = [block for block in blocks if not has_place(block.candidate.effect)]
    for count in range(MOST_PLACED[size] + 1):
        placed = _by_labels(combinations(local, count))
        for others in combinations(everywhere, size - count):
            members = [block.candidate for block in others]
            if all(may_act(one, members[:n]) for n, one in enumerate(members)):
                yield from (_Groups(others, *alike) for alike in placed)


def _by_labels(
    places: Iterator[tuple[_Block, ...]],
) -> list[tuple[list[tuple[_Block, ...]], NDArray[np.intp]]]:
    """Return the tuples of blocks that have the same labels together, with their columns."""
    sorted_out: dict[tuple[str, ...], list[tuple[_Block, ...]]] = {}
    for blocks in places:
        sorted_out.setdefault(tuple(block.candidate.label for block in blocks), []).append(blocks)
    return [
        (alike, np.array([[block.columns[0] for block in blocks] for blocks in alike], np.intp))
        for alike in sorted_out.values()
    ]


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


def _best(groups: _Groups, gram: FloatArray, moments: FloatArray) -> _Explanation:
    """Return the group with the largest reduced gain; all are solved at once.

    The gain is zero where a leak or a zone would need the opposite sign.
    """
    none = np.zeros(0, np.intp)
    shared = np.concatenate([none, *(block.columns for block in groups.everywhere)])
    count = len(groups.placed)
    columns = np.hstack([np.broadcast_to(shared, (count, len(shared))), groups.columns])
    each = columns.shape[1]
    squares, own = gram[columns[:, :, None], columns[:, None, :]], moments[columns]
    ridge = RIDGE * np.maximum(np.trace(squares, axis1=1, axis2=2) / each, 1e-30)
    squares[:, range(each), range(each)] += ridge[:, None]
    amounts = np.linalg.solve(squares, own[..., None])[..., 0]
    gains = np.sum(amounts * own, axis=1) * PARTNER_GAIN_PER_PARAMETER**each
    gains[np.any(amounts[:, len(shared) :] <= 0.0, axis=1)] = 0.0
    best = int(np.argmax(gains))
    return _Explanation(
        float(gains[best]), (*groups.everywhere, *groups.placed[best]), amounts[best]
    )


def _moved(candidate: Candidate, steps: FloatArray) -> Candidate:
    """Return `candidate` with a start that is `steps` further, within its ranges."""
    start = tuple(
        float(np.clip(first + step, *parameter.range))
        for first, step, parameter in zip(candidate.first, steps, candidate.parameters, strict=True)
    )
    return replace(candidate, starts=(start,))
