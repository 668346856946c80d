"""The search for what explains a gap: every effect alone, then in pairs, coarse before fine.

1. Screening: every candidate is fitted with the full model on cells twice as large.
2. Refinement: what is left is fitted again on the recording's cells, and judged on cells half as
   large, where the scheme smears least, with what the finest cells change in one run of each.
3. Pairs, where no single effect closes the gap: those whose response the best single effects cannot
   copy; in the best of them either member makes way for what explains more beside the other, as
   long as that helps. They are screened, refined and judged in the same way.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize_scalar

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.candidates import LOCAL, Candidate, library, pumping_wells
from porotwin_diagnosis.evidence import WIDTH, Sample, coarsened
from porotwin_diagnosis.fit import Fit, Fitter
from porotwin_diagnosis.forward import Forward, on_rough_sand
from porotwin_diagnosis.scan import starts

Progress = Callable[[str, float], None]
"""Told the stage and the share that is done."""

SCREENING, SCREENING_COLUMNS = 2, 40
"""Cells of the recording per screening cell, each way, as long as so many columns are left."""

JUDGING, FINEST = 2, 3
"""Cells per cell of the recording in the final judgement, each way, and in the one run of every
judged model that tells what its cells do wrong."""

SLOW, MOST_CELLS = 'dispersion', 250_000
"""An effect of which a run on more than so many cells takes minutes, and is left out."""

EXTRAPOLATION = 1.6
"""How many times the change from judging to finest cells is taken off (Richardson): with errors
that fall with the cells' size to the power of 1 to 1.4, as seen, it would be 2.3 to 3.3 in full."""

REFINED, JUDGED, PAIR_BASES, PARTNERS, SCREENED_AGAIN = 7, 4, 3, 4, 6
"""How many fits go on at most: to refinement, to judgement; bases of pairs, partners; screened
fits that are fitted again before pairs are made of them."""

EXCHANGES = 4
"""How many times at most the best pair exchanges its members."""

MOVED = 2
"""How many pairs with a leak or a zone have it put elsewhere, and to how many places."""

LIKELY_SECONDS = ('saturation', 'illumination')
"""Partners that are always tried: they cost no simulation, and their response is not linear."""

BASE = 1.8
"""Fits whose misfit is above this many times the best one's are no base of a pair: the strongest
effect of a pair need not be what imitates the pair best."""

NEAR = 1.5
"""Fits whose misfit is above this many times the best one's go no further (but the second)."""

HOPELESS = 2.0
"""Fits of coarse residuals that leave this many times the best one's misfit are not finished."""

SMALL_GAP = 4.0
"""Misfit of a model below which coarse runs are corrected by what finer cells change in it: the
model as it is, or the best single effect where no pair was found. Above it fronts lie too far apart
for that correction to stay in place."""

ALIKE = 1.03
"""Fits whose misfit is within this factor of the last one that goes on go on with it."""

EXPLAINED = 0.5
"""Excess below which a judged effect leaves nothing for a second one."""

NEARLY_CLOSED = 1.5
"""Excess of the best model below which it is worth to look more closely: with more pairs, and with
finer cells."""

AT_A_WELL = 5.0
"""Cells about a well within which a leak cannot be told from a wrong rate of that well."""

OCCAM, SCREENING_OCCAM = 1.08, 1.05
"""Every knob must lower the misfit by this factor to be preferred, at last and among screened
pairs: a wrong effect with many knobs takes up some of what the schemes do wrong."""

PER_KNOB = 0.85
"""By what every knob lowers the gain of a partner: many knobs imitate much."""

EDGE_BLUR = 0.55
"""Blur [cells] by which recorded maps are softer than averages over cells, until measured."""

NOISE_DOUBT = 1.1
"""By how much the noise may be stronger than measured."""

VISCOUS = 1.5
"""How much more a viscosity may leave, for the flow that it drives is solved on coarser cells (true
ones left 0.26 to 0.69, other effects half of it); a thinner tracer as many times more as it
magnifies what nobody knows of the sand."""

ROUGH_SANDS = 2
"""Sands with which that is measured."""

SMALL_EXCESS = 0.8
"""Excess of the model as it is below which the model without any effect counts as the best."""

BLURS = (0.3, 0.9)
"""Least and largest blur [cells] that is put down to the camera."""


@dataclass
class Findings:
    """All fits at the finest level each has reached; `null` and
    `screened_null` are the model without any effect, judged and as screened.

    `distances` are those of the predictions of all `singles` from the best one's, `pair_distances`
    those of `pairs`. `parts` are the members of the best pair, each alone with the parameters that
    it has there, `part_changes` the relative L2 norms of what each changes in the held-out maps.
    """

    null: Fit
    screened_null: Fit
    screened: list[Fit]
    singles: list[Fit] = field(default_factory=list)
    pairs: list[Fit] = field(default_factory=list)
    distances: list[float] = field(default_factory=list)
    pair_distances: list[float] = field(default_factory=list)
    parts: list[Fit] = field(default_factory=list)
    part_changes: list[float] = field(default_factory=list)
    runs: int = 0


def beyond_noise(fit: Fit) -> tuple[float, ...]:
    """Return what a judged `fit` leaves beyond the noise, of the fitted and of the held-out part,
    in units of the share of a cell by which no front is known."""
    parts = zip((fit.fitted, fit.held_out), fit.noise, strict=True)
    return tuple(
        math.sqrt(max(all_of_it**2 - (NOISE_DOUBT * noise) ** 2, 0.0)) for all_of_it, noise in parts
    )


def excess(fit: Fit) -> float:
    """Return what `fit` leaves `beyond_noise` of the part where it leaves more, as a multiple of
    what a model that is right may leave: of a viscosity, and of one that magnifies how rough the
    sand is, that is more."""
    viscous = any(member.effect == 'viscosity' for member in fit.members)
    parts = zip(beyond_noise(fit), fit.magnified, strict=True)
    return max(left / magnified for left, magnified in parts) / (VISCOUS if viscous else 1.0)


def score(fit: Fit) -> float:
    """Return the misfit of fitted and held-out part together."""
    return overall(fit.fitted, fit.held_out)


def worse(fit: Fit) -> float:
    """Return the misfit of the part, fitted or held out, where `fit` leaves more: a wrong effect
    adapts to what it is fitted to, and fails in what it has not seen."""
    return max(fit.fitted, fit.held_out)


def overall(fitted: float, held_out: float) -> float:
    """Return the misfit of both parts together, of theirs."""
    return float(np.hypot(fitted, held_out) / np.sqrt(2.0))


class Search:
    """Looks for effects in recordings of one rig."""

    def __init__(
        self,
        samples: Sequence[Sample],
        *,
        excluded: Sequence[str] = (),
        progress: Progress = lambda _stage, _share: None,
        workers: int = 2,
    ) -> None:
        """Search `samples` without the effects named in `excluded`."""
        self.samples = list(samples)
        self.excluded = frozenset(excluded)
        known = {candidate.effect for candidate in library(samples)} | set(LOCAL)
        if not known - set(LOCAL) - self.excluded:
            raise InputError('all effects without a place are excluded; leave at least one in')
        self.progress = progress
        self._pool = ThreadPoolExecutor(workers) if workers > 1 else None
        coarse = [coarsened(sample, _screening_factor(sample)) for sample in samples]
        self.screening = self._fitter(coarse, 1, 0.5 * EDGE_BLUR)
        self.refining = self._fitter(samples, 1, EDGE_BLUR)
        rough = [
            [Forward(on_rough_sand(sample, seed), refinement=JUDGING) for sample in samples]
            for seed in range(ROUGH_SANDS)
        ]
        self.judging = self._fitter(samples, JUDGING, EDGE_BLUR, rough)
        self.finest = [Forward(sample, refinement=FINEST) for sample in samples]

    def _fitter(
        self,
        samples: Sequence[Sample],
        refinement: int,
        soft: float,
        rough: Sequence[Sequence[Forward]] = (),
    ) -> Fitter:
        forwards = [Forward(sample, refinement=refinement) for sample in samples]
        return Fitter(forwards, soft=soft, rough=rough, pool=self._pool)

    def run(self) -> Findings:
        """Return what was found."""
        self.progress('running the model as it is', 0.0)
        null = self.judging.judged((), np.zeros(0))
        if score(null) < SMALL_GAP:
            self._lean(())
        screened = self._screen()
        findings = Findings(null, self.screening.judged((), np.zeros(0)), screened)
        refined = self._refined(_near(_distinct(screened))[:REFINED], 0.3)
        findings.singles = self._judged(refined, 0.4)
        findings.singles = self._sharpened(findings, findings.singles, 0.48)
        self._attune(findings.null)
        findings.null = self.judging.judged((), np.zeros(0))
        best = findings.singles[0]
        if excess(best) > EXPLAINED:
            findings.pairs = self._judged_pairs(findings, screened)
            open_still = not findings.pairs or excess(findings.pairs[0]) > EXPLAINED
            if open_still and score(best) < SMALL_GAP:
                self._lean(best.effects)
                more = self._judged_pairs(findings, self._screened_again(best, screened))
                findings.pairs = self._ranked([*findings.pairs, *more])
            if findings.pairs and EXPLAINED < excess(findings.pairs[0]) < NEARLY_CLOSED:
                findings.pairs = self._ranked(
                    [*findings.pairs, *self._beside_the_best(findings, screened)]
                )
            if findings.pairs:
                self._attune(findings.pairs[0])
        findings.parts = [
            self.judging.judged((member,), turns)
            for pair in findings.pairs[:1]
            for member, turns, _ in pair.parts()
        ]
        self._tried_again_alone(findings)
        findings.part_changes = [self._change(part.effects) for part in findings.parts]
        findings.distances = self._distances(findings.singles)
        findings.pair_distances = self._distances(findings.pairs)
        fitters = (self.screening, self.refining, self.judging)
        forwards = [forward for fitter in fitters for forward in fitter.forwards]
        findings.runs = sum(forward.runs for forward in (*forwards, *self.finest))
        return findings

    def _lean(self, effects: Sequence[EffectDescription]) -> None:
        """Correct coarse runs from now on by what the judging cells change with `effects`."""
        for fitter in (self.screening, self.refining):
            for forward, finer in zip(fitter.forwards, self.judging.forwards, strict=True):
                forward.lean_on(finer, effects)

    def _tried_again_alone(self, findings: Findings) -> None:
        """Fit a member of the best pair alone once more if, as it is there, it leaves less than
        every single fit: its own stood still before it found its place."""
        moved = [part for part in findings.parts if score(part) < score(findings.singles[0])]
        if moved:
            again = self._judged(self._refined(moved, 0.89), 0.9)
            fits = [*self._sharpened(findings, again, 0.9), *findings.singles]
            findings.singles = self._ranked(fits)

    def _sharpened(self, findings: Findings, fits: Sequence[Fit], begin: float) -> list[Fit]:
        """Return `fits` judged again: what nearly closes the gap with what finer cells change in it
        and with the edge blur that suits it, the others with the blur of the best.

        A picture that is moved is also blurred; a wrong model's blur would be that of its misplaced
        fronts.
        """
        if not fits:
            return []
        small = excess(findings.null) < SMALL_EXCESS
        best = findings.null if small else fits[0]
        self._measure_blur(best)
        near = [fit for fit in fits if excess(fit) <= NEARLY_CLOSED]
        far = [fit for fit in fits if excess(fit) > NEARLY_CLOSED]
        polished = []
        for index, fit in enumerate([*near, *far]):
            self.progress(f'polishing {fit.label}', begin + 0.05 * index / len(fits))
            self._attune(best if fit in far else fit)
            polished.append(self.judging.polished(fit, self.refining))
        self._attune(best)
        return self._ranked(polished)

    def _change(self, effects: Sequence[EffectDescription]) -> float:
        """Return the relative L2 norm of what `effects` change in the held-out maps, on cells so
        fine that fronts smeared by the scheme do not count."""
        changes = []
        for forward, finer in zip(self.judging.forwards, self.finest, strict=True):
            sharp = finer if _is_quick(finer, effects) else forward
            begin = forward.sample.fitted
            changes.append(relative_error(sharp.maps(effects)[begin:], sharp.maps(())[begin:]))
        return float(np.sqrt(np.mean(np.square(changes))))

    def _attune(self, fit: Fit) -> None:
        """Judge from now on with blur and finest cells of `fit`, if that nearly closes the gap."""
        if excess(fit) > NEARLY_CLOSED:
            return
        for forward, finer in zip(self.judging.forwards, self.finest, strict=True):
            forward.offset = None
            if _is_quick(finer, fit.effects):
                forward.lean_on(finer, fit.effects, extrapolation=EXTRAPOLATION)
        self._measure_blur(fit)

    def _measure_blur(self, fit: Fit) -> None:
        """Judge from now on with the edge blur that suits `fit`."""

        def cost(blur: float) -> float:
            self.judging.soft = blur
            return self.judging.judged(fit.members, fit.turns).fitted

        found = minimize_scalar(cost, bounds=BLURS, method='bounded', options={'xatol': 0.02})
        self.judging.soft = float(found.x)

    def _distances(self, fits: Sequence[Fit]) -> list[float]:
        return [self.judging.distance(fits[0], fit) for fit in fits]

    def _screen(self) -> list[Fit]:
        candidates = [
            candidate
            for candidate in library(self.samples)
            if candidate.effect not in self.excluded and candidate.effect not in LOCAL
        ]
        fits: list[Fit] = []
        for index, candidate in enumerate(candidates):
            self.progress(f'trying {candidate.label}', 0.02 + 0.15 * index / len(candidates))
            fits.append(self._best_start(candidate))
        fits = _possible(fits)
        limit = HOPELESS * min(map(score, fits))
        for index, fit in enumerate(fits):
            if score(fit) < limit:
                self.progress(f'fitting {fit.label}', 0.17 + 0.12 * index / len(fits))
                fits[index] = self.screening.fit(fit.members, start=fit.turns, coarse_steps=0)
        for effect in sorted(set(LOCAL) - self.excluded):
            self.progress(f'looking for a place of {effect}', 0.29)
            fits.extend(self._local(effect))
        return sorted(_possible(fits), key=score)

    def _best_start(self, candidate: Candidate) -> Fit:
        tried = [
            self.screening.fit((candidate,), start=np.array(first, dtype=float), fine_steps=0)
            for first in candidate.starts or ((0.0,) * len(candidate.knobs),)
        ]
        return min(tried, key=score)

    def _local(self, effect: str) -> list[Fit]:
        """Return the best of the fits that start at the most promising places."""
        fits = [self.screening.fit((place,), coarse_steps=4) for place in self._starts(effect)]
        return sorted((fit for fit in _possible(fits) if not self._at_a_well(fit)), key=score)[:1]

    def _starts(self, effect: str, *, beside: Fit | None = None) -> list[Candidate]:
        """Return the most promising starts of a local `effect`; none where no run can tell."""
        try:
            return starts(self.screening.forwards, effect, beside=beside, pool=self._pool)
        except InputError:
            return []

    def _at_a_well(self, fit: Fit) -> bool:
        """Return whether `fit` has a leak at a pump's well, which is that pump's wrong rate."""
        sample = self.samples[0]
        pumping = [sample.rig.wells[name] for name in pumping_wells(self.samples)]
        leaks = [effect.parameters for effect in fit.effects if effect.name == 'leak']
        return any(
            np.hypot(float(leak['x']) - well.x_m, float(leak['z']) - well.z_m)
            < well.radius_m + AT_A_WELL * sample.grid.dx
            for leak in leaks
            for well in pumping
        )

    def _pairs(self, findings: Findings, screened: Sequence[Fit]) -> list[Fit]:
        bases, thorough = _bases(findings.singles[0], screened)
        fits: dict[frozenset[str], Fit] = {}
        for index, base in enumerate(bases):
            self.progress(f'pairs with {base.label}', 0.54 + 0.12 * index / len(bases))
            partners = self._partners(base, screened, thorough=index < thorough)
            fits |= self._beside(base, partners, fits.keys())
        fits |= self._elsewhere(fits)
        fits |= self._exchanged(fits, screened)
        return sorted(fits.values(), key=lambda fit: score(fit) * SCREENING_OCCAM ** len(fit.turns))

    def _exchanged(
        self, fits: Mapping[frozenset[str], Fit], screened: Sequence[Fit]
    ) -> dict[frozenset[str], Fit]:
        """Return what the best pair of `fits` becomes where either member makes way for another,
        and the best of those again, until that explains no more.

        What imitates an effect best alone, as a moved picture does sorption, need not be it.
        """
        found: dict[frozenset[str], Fit] = {}
        if not fits:
            return found
        best = min(fits.values(), key=score)
        for _ in range(EXCHANGES):
            for member, turns, _ in best.parts():
                self.progress(f'another beside {member.label}', 0.65)
                base = self.screening.judged((member,), turns)
                partners = self._partners(base, screened, thorough=False)
                found |= self._beside(base, partners, fits.keys() | found.keys())
            last = min(found.values(), key=score, default=best)
            if score(last) >= score(best):
                break
            best = last
        return found

    def _elsewhere(self, fits: Mapping[frozenset[str], Fit]) -> dict[frozenset[str], Fit]:
        """Return what is better of the best pairs in `fits` with a leak or a zone put where that
        explains most beside the other member: where it was found alone, it imitated both."""
        found: dict[frozenset[str], Fit] = {}
        local = [fit for fit in fits.values() if any(m.effect in LOCAL for m in fit.members)]
        for pair in sorted(local, key=score)[:MOVED]:
            parts = [(member, turns) for member, turns, _ in pair.parts()]
            for (member, _), (other, turns) in (parts, parts[::-1]):
                if member.effect not in LOCAL:
                    continue
                self.progress(f'another place of {member.label}', 0.65)
                base = self.screening.judged((other,), turns)
                for place in self._starts(member.effect, beside=base)[:MOVED]:
                    for key, moved in self._beside(base, [place], ()).items():
                        found[key] = min(moved, found.get(key, pair), key=score)
        return found

    def _beside(
        self, base: Fit, partners: Sequence[Candidate], known: Collection[frozenset[str]]
    ) -> dict[frozenset[str], Fit]:
        """Return the fits of `base` with each of `partners` but the `known` pairs, by labels, and
        but leaks that moved to a well."""
        fits: dict[frozenset[str], Fit] = {}
        for partner in partners:
            members = (*base.members, partner)
            key = _labels(members)
            if key not in known and key not in fits:
                start = np.concatenate([base.turns, partner.first])
                fits[key] = self.screening.fit(members, start=start, coarse_steps=1, fine_steps=4)
        return {key: fit for key, fit in fits.items() if fit.possible and not self._at_a_well(fit)}

    def _judged_pairs(self, findings: Findings, screened: Sequence[Fit]) -> list[Fit]:
        """Return the best pairs of `screened` effects, judged."""
        pairs = self._judged(self._refined_pairs(findings, screened), 0.78)
        return self._sharpened(findings, pairs, 0.86)

    def _beside_the_best(self, findings: Findings, screened: Sequence[Fit]) -> list[Fit]:
        """Return what the best judged pair becomes, judged, where either member makes way for
        another: coarse cells may have hidden that."""
        best = findings.pairs[0]
        found = self._exchanged({_labels(best.members): best}, screened)
        refined = self._refined(sorted(found.values(), key=score)[:REFINED], 0.87)
        return self._sharpened(findings, self._judged(refined, 0.88), 0.9)

    def _refined_pairs(self, findings: Findings, screened: Sequence[Fit]) -> list[Fit]:
        """Return the best pairs of `screened` effects, refitted on the recording's cells.

        Coarse cells confuse effects that delay or pale the plume alike, so that where a pair nearly
        closes the gap, more of them get their turn.
        """
        pairs = _near(self._pairs(findings, screened))[:REFINED]
        refined = self._refined(pairs[:JUDGED], 0.66)
        if refined and excess(refined[0]) < NEARLY_CLOSED:
            refined += self._refined(pairs[JUDGED:], 0.72)
        return sorted(refined, key=score)

    def _screened_again(self, best: Fit, screened: Sequence[Fit]) -> list[Fit]:
        """Return `screened` with the first of them, and the `best` as judged, fitted again on cells
        whose correction has changed."""
        again = _possible(
            [
                self.screening.fit(fit.members, start=fit.turns, coarse_steps=0)
                for fit in _led_by(best, _distinct(screened))[:SCREENED_AGAIN]
            ]
        )
        kept = {fit.label for fit in again}
        return sorted([*again, *(fit for fit in screened if fit.label not in kept)], key=score)

    def _partners(self, base: Fit, screened: Sequence[Fit], *, thorough: bool) -> list[Candidate]:
        """Return the candidates whose response best explains what `base` leaves.

        If `thorough`, also all that have one knob and no place, and those that need a place,
        wherever they fit best beside `base`.
        """
        fitter = self.screening
        residuals = fitter.residuals(base.effects, WIDTH)
        own = fitter.responses(base.members, base.turns)
        gains: list[tuple[float, Candidate]] = []
        for fit in screened:
            candidate = fit.members[0]
            if candidate.effect == base.members[0].effect or candidate.effect in LOCAL:
                continue
            members = (*base.members, candidate)
            turns = np.concatenate([base.turns, candidate.first])
            added = fitter.responses(members, turns, first=len(base.turns))
            gain = _gain(residuals, own, added)
            gains.append((gain * PER_KNOB ** len(candidate.knobs), candidate))
        gains.sort(key=lambda item: -item[0])
        partners = [
            candidate
            for place, (_, candidate) in enumerate(gains)
            if place < PARTNERS
            or candidate.effect in LIKELY_SECONDS
            or (thorough and len(candidate.knobs) == 1 and 'well' not in candidate.fixed)
        ]
        local = set(LOCAL) - self.excluded - {base.members[0].effect}
        for effect in sorted(local) if thorough else ():
            partners.extend(self._starts(effect, beside=base)[:1])
        return partners

    def _refined(self, fits: Sequence[Fit], begin: float) -> list[Fit]:
        """Return `fits` refitted on the recording's cells; progress is at `begin`."""
        refined = []
        for index, fit in enumerate(fits):
            self.progress(f'refining {fit.label}', begin + 0.06 * index / len(fits))
            refined.append(
                self.refining.fit(fit.members, start=fit.turns, coarse_steps=0, fine_steps=3)
            )
        return sorted(_possible(refined), key=score)

    def _judged(self, refined: Sequence[Fit], begin: float) -> list[Fit]:
        """Return the best of `refined`, refitted on the finest cells; progress is at `begin`."""
        judged = []
        for index, fit in enumerate(_near(refined)[:JUDGED]):
            self.progress(f'judging {fit.label}', begin + 0.08 * index / JUDGED)
            judged.append(self.judging.polished(fit, self.refining))
        return self._ranked(_possible(judged))

    def _ranked(self, fits: Sequence[Fit]) -> list[Fit]:
        """Return the judged `fits`, the most plausible first, without leaks that moved to a well
        unless all did; of what was fitted twice the better one."""
        kept = [fit for fit in fits if not self._at_a_well(fit)] or fits
        best: dict[frozenset[str], Fit] = {}
        for fit in sorted(kept, key=lambda fit: worse(fit) * OCCAM ** len(fit.turns)):
            best.setdefault(_labels(fit.members), fit)
        return list(best.values())


def _is_quick(finest: Forward, effects: Sequence[EffectDescription]) -> bool:
    """Return whether a run of the `finest` cells with `effects` takes seconds."""
    cells = finest.sample.grid.nx * finest.sample.grid.nz * FINEST**2
    return cells <= MOST_CELLS or all(effect.name != SLOW for effect in effects)


def _possible(fits: Sequence[Fit]) -> list[Fit]:
    return [fit for fit in fits if fit.possible]


def forward_only(progress: Progress) -> Progress:
    """Return `progress` with shares that never go back where a stage is gone through again."""
    reached = 0.0

    def told(stage: str, share: float) -> None:
        nonlocal reached
        reached = max(reached, share)
        progress(stage, reached)

    return told


def _screening_factor(sample: Sample) -> int:
    return SCREENING if sample.grid.nx >= SCREENING * SCREENING_COLUMNS else 1


def _near(fits: Sequence[Fit]) -> list[Fit]:
    """Return the fits near the best of `fits`, which are in order, and the second in any case."""
    if not fits:
        return []
    kept = [
        fit for index, fit in enumerate(fits) if index < 2 or score(fit) < NEAR * score(fits[0])
    ]
    return [fit for fit in fits if score(fit) <= ALIKE * score(kept[-1])]


def _labels(members: Sequence[Candidate]) -> frozenset[str]:
    return frozenset(member.label for member in members)


def _kind(fit: Fit) -> tuple[str, object]:
    """Return the effect and well of a single effect's `fit`, variants of one effect being one."""
    member = fit.members[0]
    return member.effect, member.fixed.get('well')


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Return the best fit of every effect and well."""
    best: dict[tuple[str, object], Fit] = {}
    for fit in fits:
        best.setdefault(_kind(fit), fit)
    return list(best.values())


def _led_by(best: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """Return `fits` with those of the effect that was judged the `best` first."""
    return sorted(fits, key=lambda fit: _kind(fit) != _kind(best))


def _bases(best: Fit, screened: Sequence[Fit]) -> tuple[list[Fit], int]:
    """Return the single effects that pairs are made of, and how many of them deserve all partners.

    On coarse cells the effect that was judged the `best` may stand behind others.
    """
    alone = _distinct(screened)
    near = [fit for fit in alone if score(fit) < BASE * score(alone[0])][:PAIR_BASES]
    judged = [fit for fit in alone if _kind(fit) == _kind(best)]
    bases = judged + [fit for fit in near if _kind(fit) != _kind(best)]
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
