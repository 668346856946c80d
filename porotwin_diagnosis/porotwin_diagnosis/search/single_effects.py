"""Fits of every single effect of the library on coarse cells."""

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.library import beginnings, library
from porotwin_diagnosis.progress import steps_of
from porotwin_diagnosis.search.levels import REFINING_ITERATIONS, Levels
from porotwin_diagnosis.search.place_scan import promising_starts, sized_trials_at
from porotwin_diagnosis.search.ranking import (
    feasible,
    first_of_each_effect,
    score,
)
from porotwin_diagnosis.thresholds import CLOSE_TO_BEST
from porotwin_solver.effects import effects_of
from porotwin_solver.effects.definition.candidate import Candidate
from porotwin_solver.effects.definition.effect import Scope

PLACED_COARSE_ITERATIONS = 4
"""Iterations on coarse residuals for an effect with a place: its place is known to a few cells."""

SIZED_ITERATIONS = 6
"""Iterations on fine residuals of a fit of an effect at the place of another one."""


class SearchSpace(NamedTuple):
    """The effects of a search: `candidates` without a place, names of effects with a place, and
    those that may begin during the recording."""

    candidates: tuple[Candidate, ...]
    local_effects: tuple[str, ...]
    beginning: tuple[Candidate, ...] = ()


def search_space(samples: Sequence[Sample], excluded: Collection[str]) -> SearchSpace:
    """Return all effects of the library for `samples` but the `excluded` ones.

    Raises:
        InputError: no effect without a place remains.
    """
    local = {effect.name for effect in effects_of(Scope.PLACE)}
    candidates = tuple(
        candidate for candidate in library(samples) if candidate.effect not in {*excluded, *local}
    )
    if not candidates:
        raise InputError('all effects without a place are excluded; leave at least one in')
    beginning = tuple(one for one in beginnings(samples) if one.effect not in excluded)
    return SearchSpace(candidates, tuple(sorted(local - set(excluded))), beginning)


class Tried(NamedTuple):
    """The fits of single effects so far, the best score first, and the names of the others."""

    fits: list[Fit]
    left: tuple[str, ...]


def screened_singles(levels: Levels, space: SearchSpace, coarse: Sequence[Fit]) -> Iterator[Tried]:
    """Yield the fits of single effects on the screening cells; the last ones are all.

    The promising ones of the `coarse` fits, which have no place, go on to fine residuals. An effect
    with a place is fitted from the most promising places.

    """
    limit = CLOSE_TO_BEST * score(coarse[0])

    step = steps_of(levels.progress, 0.08, 0.06, len(coarse))

    def fitted(fit: Fit) -> Fit:
        if score(fit) >= limit:
            return fit
        with step(f'fitting {fit.label}'):
            return _continued(levels, fit)

    fits = levels.side_by_side(fitted, coarse)
    placed: list[Fit] = []
    for number, effect in enumerate(space.local_effects):
        yield Tried(_sorted([*fits, *placed]), space.local_effects[number:])
        levels.progress(f'looking for a place of {effect}', 0.14)
        placed += _best_placed(levels, place_starts(levels, effect))
    exchanged = [
        fit for one in placed if score(one) < limit for fit in _exchanged(levels, space, one)
    ]
    yield Tried(_sorted([*fits, *_best_of_each(placed, exchanged)]), ())


def coarsely_fitted_singles(levels: Levels, space: SearchSpace) -> Iterator[Tried]:
    """Yield fits of the effects without a place to coarse residuals; the last ones are all.

    Raises:
        InputError: the model cannot run with any of them.
    """
    candidates = space.candidates
    step = steps_of(levels.progress, 0.01, 0.07, len(candidates))

    def tried(number: int) -> tuple[int, Fit]:
        with step(f'trying {candidates[number].label}'):
            return number, _fit_from_best_start(levels, candidates[number])

    found: dict[int, Fit] = {}
    for number, fit in levels.as_made(tried, range(len(candidates))):
        found[number] = fit
        left = [one.effect for n, one in enumerate(candidates) if n not in found]
        fits = [found[n] for n in sorted(found)]  # equal scores keep the order of the library
        if feasible(fits):
            yield Tried(_sorted(fits), tuple(dict.fromkeys([*left, *space.local_effects])))
    if not feasible(list(found.values())):
        raise InputError('the model cannot run with any effect of the library on this recording')


def _sorted(fits: Sequence[Fit]) -> list[Fit]:
    """Return the feasible `fits`, the best score first."""
    return sorted(feasible(fits), key=score)


def place_starts(levels: Levels, effect: str) -> list[Candidate]:
    """Return the promising starts of an `effect` with a place, the best first.

    The result is empty if no simulation can tell.
    """
    try:
        return promising_starts(levels.screening.forwards, effect, pool=levels.pool)
    except InputError:
        return []


def _fit_from_best_start(levels: Levels, candidate: Candidate) -> Fit:
    """Return the best fit of `candidate` to coarse residuals from any of its starts."""
    starts = candidate.starts or (candidate.first,)
    fits = [
        levels.screening.fit((candidate,), start=np.array(start, dtype=float), fine_steps=0)
        for start in starts
    ]
    return min(fits, key=score)


def _continued(levels: Levels, fit: Fit, *, fine_steps: int = REFINING_ITERATIONS) -> Fit:
    return levels.screening.fit(
        fit.members, start=fit.scaled_parameters, coarse_steps=0, fine_steps=fine_steps
    )


def _best_placed(levels: Levels, starts: Sequence[Candidate]) -> list[Fit]:
    """Return the best fit of an effect from any of the `starts`; empty if there is none."""
    fits = levels.side_by_side(
        lambda start: levels.screening.fit((start,), coarse_steps=PLACED_COARSE_ITERATIONS), starts
    )
    return _best_away_from_wells(levels, fits)


def _best_away_from_wells(levels: Levels, fits: Sequence[Fit]) -> list[Fit]:
    """Return the best feasible fit that is no leak at a well; empty if there is none."""
    away_from_wells = [fit for fit in feasible(fits) if not levels.has_leak_at_well(fit)]
    return sorted(away_from_wells, key=score)[:1]


def _exchanged(levels: Levels, space: SearchSpace, placed: Fit) -> list[Fit]:
    """Return the best fit of every other effect with a place, started at the place of `placed`.

    A leak beside a zone imitates it, and its fit may come closer than the places of the scan. As
    the place is nearly known, the fits begin with fine residuals: on coarse ones a zone that is
    too large or too tight is driven away.
    """
    (member,) = placed.effects
    x, z = (float(member.parameters[name]) for name in ('x', 'z'))
    sample = levels.screening.samples[0]
    return [
        fit
        for effect in space.local_effects
        if effect != member.name
        for fit in _best_sized(levels, sized_trials_at(sample, effect, (x, z)))
    ]


def _best_sized(levels: Levels, trials: Sequence[Candidate]) -> list[Fit]:
    """Return the best fit from the most promising of `trials` at one place; empty if none is."""
    tried = levels.side_by_side(
        lambda trial: levels.screening.evaluate((trial,), np.array(trial.first)), trials
    )
    best = sorted(feasible(tried), key=score)[:1]
    fits = levels.side_by_side(
        lambda fit: _continued(levels, fit, fine_steps=SIZED_ITERATIONS), best
    )
    return _best_away_from_wells(levels, fits)


def _best_of_each(fits: Sequence[Fit], others: Sequence[Fit]) -> list[Fit]:
    """Return the fit with the best score of every effect among `fits` and `others`."""
    return first_of_each_effect(sorted([*fits, *others], key=score))
