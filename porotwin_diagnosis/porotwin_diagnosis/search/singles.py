"""Every effect of the library alone, on coarse cells."""

from collections.abc import Collection, Sequence

import numpy as np

from porotwin_core.errors import InputError
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import distinct, kind, possible, score
from porotwin_diagnosis.search.scan import starts
from porotwin_solver.effects import effects_of
from porotwin_solver.effects.definition.candidate import Candidate
from porotwin_solver.effects.definition.effect import Scope

HOPELESS = 2.0
"""Fits of coarse residuals that leave this many times the best one's misfit are not finished."""

SCREENED_AGAIN = 6
"""How many screened fits are fitted again at most before pairs are made of them."""


class Singles:
    """Screens effects, one at a time: those that act everywhere, and the best places of others."""

    def __init__(self, levels: Levels, excluded: Collection[str]) -> None:
        """Screen all but the effects named in `excluded`.

        Raises:
            InputError: no effect without a place is left.
        """
        self._levels = levels
        local = {effect.name for effect in effects_of(Scope.PLACE)}
        self.local = sorted(local - set(excluded))
        self._candidates = [
            candidate
            for candidate in library(levels.samples)
            if candidate.effect not in {*excluded, *local}
        ]
        if not self._candidates:
            raise InputError('all effects without a place are excluded; leave at least one in')

    def screened(self) -> list[Fit]:
        """Return the fits of all effects, the best first."""
        fits: list[Fit] = []
        for index, candidate in enumerate(self._candidates):
            share = 0.02 + 0.15 * index / len(self._candidates)
            self._levels.progress(f'trying {candidate.label}', share)
            fits.append(self._best_start(candidate))
        fits = possible(fits)
        limit = HOPELESS * min(map(score, fits))
        for index, fit in enumerate(fits):
            if score(fit) < limit:
                self._levels.progress(f'fitting {fit.label}', 0.17 + 0.12 * index / len(fits))
                fits[index] = self._finished(fit)
        for effect in self.local:
            self._levels.progress(f'looking for a place of {effect}', 0.29)
            fits.extend(self._placed(effect))
        return sorted(possible(fits), key=score)

    def screened_again(self, best: Fit, screened: Sequence[Fit]) -> list[Fit]:
        """Return `screened` with the first of them, and the `best` as judged, fitted again on cells
        whose correction has changed."""
        led = sorted(distinct(screened), key=lambda fit: kind(fit) != kind(best))
        again = possible([self._finished(fit) for fit in led[:SCREENED_AGAIN]])
        kept = {fit.label for fit in again}
        return sorted([*again, *(fit for fit in screened if fit.label not in kept)], key=score)

    def starts(self, effect: str, *, beside: Fit | None = None) -> list[Candidate]:
        """Return the most promising starts of a local `effect`; none where no run can tell."""
        try:
            return starts(
                self._levels.screening.forwards, effect, beside=beside, pool=self._levels.pool
            )
        except InputError:
            return []

    def _best_start(self, candidate: Candidate) -> Fit:
        screening = self._levels.screening
        tried = [
            screening.fit((candidate,), start=np.array(first, dtype=float), fine_steps=0)
            for first in candidate.starts or ((0.0,) * len(candidate.parameters),)
        ]
        return min(tried, key=score)

    def _finished(self, fit: Fit) -> Fit:
        return self._levels.screening.fit(fit.members, start=fit.scaled, coarse_steps=0)

    def _placed(self, effect: str) -> list[Fit]:
        """Return the best of the fits that start at the most promising places."""
        fits = [
            self._levels.screening.fit((place,), coarse_steps=4) for place in self.starts(effect)
        ]
        away = [fit for fit in possible(fits) if not self._levels.at_a_well(fit)]
        return sorted(away, key=score)[:1]
