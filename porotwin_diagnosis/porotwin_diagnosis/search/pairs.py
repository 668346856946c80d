"""Two effects at once: which are worth a fit together, and what the best of them become.

Partners of the best single effects are those whose response these cannot copy. In the best pair
either member makes way for what explains more beside the other, as long as that helps. Pairs are
screened, refined and judged as single effects are.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_diagnosis.data.sample import WIDTH
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.levels import JUDGED, REFINED, Levels
from porotwin_diagnosis.search.ranking import (
    NEARLY_CLOSED,
    distinct,
    kind,
    labels,
    near,
    normalised_misfit,
    score,
)
from porotwin_diagnosis.search.singles import Singles
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate

BASES, PARTNERS = 3, 4
"""How many single effects pairs are made of at most, and with how many partners each."""

EXCHANGES = 4
"""How many times at most the best pair exchanges its members."""

MOVED = 2
"""How many pairs with a leak or a zone have it put elsewhere, and to how many places."""

BASE = 1.8
"""Fits whose misfit is above this many times the best one's are no base of a pair: the strongest
effect of a pair need not be what imitates the pair best."""

OCCAM = 1.05
"""Every parameter must lower the misfit by this factor for a screened pair to be preferred."""

PER_KNOB = 0.85
"""By what every parameter lowers the gain of a partner: many parameters imitate much."""

Pairs = dict[frozenset[str], Fit]
"""Fits of pairs by the labels of their members."""


class PairSearch:
    """Looks for pairs of effects that explain more than one."""

    def __init__(self, levels: Levels, singles: Singles) -> None:
        self._levels = levels
        self._singles = singles

    def judged(self, screened: Sequence[Fit], best: Fit, null: Fit) -> list[Fit]:
        """Return the best pairs of `screened` single effects, judged; `best` is the best of those
        that were judged alone, `null` the model without any."""
        pairs = self._levels.judged(self._refined(screened, best), 0.78)
        return self._levels.sharpened(pairs, null, 0.86)

    def judged_beside(self, best: Fit, screened: Sequence[Fit], null: Fit) -> list[Fit]:
        """Return what the `best` judged pair becomes, judged, where either member makes way for
        another: coarse cells may have hidden that."""
        found = self.exchanged({labels(best.members): best}, screened)
        refined = self._levels.refined(sorted(found.values(), key=score)[:REFINED], 0.87)
        return self._levels.sharpened(self._levels.judged(refined, 0.88), null, 0.9)

    def _refined(self, screened: Sequence[Fit], best: Fit) -> list[Fit]:
        """Return the best pairs of `screened` effects, refitted on the recording's cells.

        Coarse cells confuse effects that delay or pale the plume alike, so that where a pair nearly
        closes the gap, more of them get their turn.
        """
        pairs = near(self._screened(screened, best))[:REFINED]
        refined = self._levels.refined(pairs[:JUDGED], 0.66)
        if refined and normalised_misfit(refined[0]) < NEARLY_CLOSED:
            refined += self._levels.refined(pairs[JUDGED:], 0.72)
        return sorted(refined, key=score)

    def _screened(self, screened: Sequence[Fit], best: Fit) -> list[Fit]:
        bases, thorough = bases_of(best, screened)
        fits: Pairs = {}
        for index, base in enumerate(bases):
            self._levels.progress(f'pairs with {base.label}', 0.54 + 0.12 * index / len(bases))
            partners = self._partners(base, screened, thorough=index < thorough)
            fits |= self._beside(base, partners, fits.keys())
        fits |= self._moved(fits)
        fits |= self.exchanged(fits, screened)
        return sorted(fits.values(), key=lambda fit: score(fit) * OCCAM ** len(fit.scaled))

    def exchanged(self, fits: Mapping[frozenset[str], Fit], screened: Sequence[Fit]) -> Pairs:
        """Return what the best pair of `fits` becomes where either member makes way for another of
        the `screened`, and the best of those again, until that explains no more.

        What imitates an effect best alone, as a moved picture does sorption, need not be it.
        """
        found: Pairs = {}
        if not fits:
            return found
        best = min(fits.values(), key=score)
        for _ in range(EXCHANGES):
            for member, scaled, _ in best.parts():
                self._levels.progress(f'another beside {member.label}', 0.65)
                base = self._levels.screening.judged((member,), scaled)
                partners = self._partners(base, screened, thorough=False)
                found |= self._beside(base, partners, fits.keys() | found.keys())
            last = min(found.values(), key=score, default=best)
            if score(last) >= score(best):
                break
            best = last
        return found

    def _moved(self, fits: Mapping[frozenset[str], Fit]) -> Pairs:
        """Return what is better of the best pairs in `fits` with a leak or a zone put where that
        explains most beside the other member: where it was found alone, it imitated both."""
        found: Pairs = {}
        local = [fit for fit in fits.values() if any(has_place(m) for m in fit.members)]
        for pair in sorted(local, key=score)[:MOVED]:
            parts = [(member, scaled) for member, scaled, _ in pair.parts()]
            for (member, _), (other, scaled) in (parts, parts[::-1]):
                if not has_place(member):
                    continue
                self._levels.progress(f'another place of {member.label}', 0.65)
                base = self._levels.screening.judged((other,), scaled)
                for place in self._singles.starts(member.effect, beside=base)[:MOVED]:
                    for key, moved in self._beside(base, [place], ()).items():
                        found[key] = min(moved, found.get(key, pair), key=score)
        return found

    def _beside(
        self, base: Fit, partners: Sequence[Candidate], known: Collection[frozenset[str]]
    ) -> Pairs:
        """Return the fits of `base` with each of `partners` but the `known` pairs, and but leaks
        that moved to a well."""
        fits: Pairs = {}
        for partner in partners:
            members = (*base.members, partner)
            key = labels(members)
            if key not in known and key not in fits:
                start = np.concatenate([base.scaled, partner.first])
                fits[key] = self._levels.screening.fit(
                    members, start=start, coarse_steps=1, fine_steps=4
                )
        at_a_well = self._levels.at_a_well
        return {key: fit for key, fit in fits.items() if fit.possible and not at_a_well(fit)}

    def _partners(self, base: Fit, screened: Sequence[Fit], *, thorough: bool) -> list[Candidate]:
        """Return the candidates whose response best explains what `base` leaves.

        If `thorough`, also all that have one parameter and no place, and those that need a place,
        wherever they fit best beside `base`.
        """
        partners = [
            candidate
            for place, candidate in enumerate(self._by_gain(base, screened))
            if place < PARTNERS
            or EFFECTS[candidate.effect].is_tried_in_every_pair
            or (thorough and len(candidate.parameters) == 1 and 'well' not in candidate.fixed)
        ]
        if thorough:
            for effect in self._singles.local:
                if effect != base.members[0].effect:
                    partners.extend(self._singles.starts(effect, beside=base)[:1])
        return partners

    def _by_gain(self, base: Fit, screened: Sequence[Fit]) -> list[Candidate]:
        """Return the `screened` effects without a place, first those that would explain most of
        what `base` leaves, to first order."""
        fitter = self._levels.screening
        residuals = fitter.residuals(base.effects, WIDTH)
        own = fitter.responses(base.members, base.scaled)
        gains: list[tuple[float, Candidate]] = []
        for candidate in (fit.members[0] for fit in screened):
            if candidate.effect == base.members[0].effect or has_place(candidate):
                continue
            members = (*base.members, candidate)
            scaled = np.concatenate([base.scaled, candidate.first])
            added = fitter.responses(members, scaled, first=len(base.scaled))
            gain = _gain(residuals, own, added) * PER_KNOB ** len(candidate.parameters)
            gains.append((gain, candidate))
        return [candidate for _, candidate in sorted(gains, key=lambda item: -item[0])]


def has_place(candidate: Candidate) -> bool:
    """Return whether the place of the candidate's effect must be found."""
    return EFFECTS[candidate.effect].has_place


def bases_of(best: Fit, screened: Sequence[Fit]) -> tuple[list[Fit], int]:
    """Return the single effects that pairs are made of, and how many of them deserve all partners.

    On coarse cells the effect that was judged the `best` may stand behind others.
    """
    alone = distinct(screened)
    close = [fit for fit in alone if score(fit) < BASE * score(alone[0])][:BASES]
    judged = [fit for fit in alone if kind(fit) == kind(best)]
    bases = judged + [fit for fit in close if kind(fit) != kind(best)]
    return bases, 1 if alone[0] in judged else 2


def _gain(
    residuals: Sequence[FloatArray], own: Sequence[FloatArray], other: Sequence[FloatArray]
) -> float:
    """Return the squared residual that `other` removes beyond `own`, to first order."""
    a = np.concatenate([part.reshape(len(part), -1) for part in own], axis=1)
    b = np.concatenate([part.reshape(len(part), -1) for part in other], axis=1)
    r = np.concatenate([part.ravel() for part in residuals])
    basis, _ = np.linalg.qr(a.T)
    r = r - basis @ (basis.T @ r)
    b = b.T - basis @ (basis.T @ b.T)
    norms = np.linalg.norm(b, axis=0)
    b = b[:, norms > 1e-9 * max(float(norms.max(initial=0.0)), 1e-12)]
    if b.shape[1] == 0:
        return 0.0
    solution, *_ = np.linalg.lstsq(b, r, rcond=1e-6)
    return float(r @ r - np.sum((r - b @ solution) ** 2))
