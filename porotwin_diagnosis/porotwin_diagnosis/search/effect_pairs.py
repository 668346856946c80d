"""Fits of two effects together.

Pairs are made from the best single effects. The partners of a single effect are the ones whose
linear response explains most of its residual and cannot be imitated by its own parameters. Pairs
are screened, refined and judged like single effects.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH
from porotwin_diagnosis.model.effect_traits import TRIED_IN_EVERY_PAIR, has_place
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.joint_scan import RIDGE, may_act
from porotwin_diagnosis.search.levels import Judgement, Levels
from porotwin_diagnosis.search.ranking import (
    close_to_best,
    effect_and_well,
    first_of_each_effect,
    member_labels,
    normalised_misfit,
    score,
)
from porotwin_diagnosis.search.single_effects import SearchSpace, place_starts
from porotwin_diagnosis.thresholds import (
    BEAM,
    CLOSE_TO_BEST,
    NEARLY_CLOSED_MISFIT,
    PARTNER_GAIN_PER_PARAMETER,
    PENALTY_PER_PARAMETER,
    RELOCATED_PAIRS,
    WIDE_BEAM,
)
from porotwin_solver.effects.definition.candidate import Candidate

PAIR_COARSE_ITERATIONS, PAIR_FINE_ITERATIONS = 1, 4
"""Iterations of a fit of a pair on coarse and on fine residuals; one member is fitted already."""

Combinations = dict[frozenset[str], Fit]
"""Fits of pairs or triples by the labels of their members."""


def judged_pairs(
    levels: Levels, space: SearchSpace, screened: Sequence[Fit], best: Fit, null: Fit
) -> Judgement:
    """Return the best pairs of single effects, judged.

    Args:
        levels: the levels of the recordings.
        space: effects of the search.
        screened: fits of single effects on the screening cells.
        best: the best judged single effect.
        null: the judged model without effects.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    pairs = levels.judged(_refined(levels, space, screened, best), 0.42)
    return levels.judged_again(pairs, null, 0.46)


def pair_bases(best: Fit, screened: Sequence[Fit]) -> tuple[list[Fit], int]:
    """Return the bases of pairs, which are single effects, and how many of them get all partners.

    The effect of `best`, the best judged fit, comes first: screening cells may have ranked it
    behind others. If they did, the first of the others gets all partners as well.
    """
    singles = first_of_each_effect(screened)
    limit = CLOSE_TO_BEST * score(singles[0])
    close = [fit for fit in singles if score(fit) < limit][:BEAM]
    judged = [fit for fit in singles if effect_and_well(fit) == effect_and_well(best)]
    others = [fit for fit in close if effect_and_well(fit) != effect_and_well(best)]
    return judged + others, 1 if singles[0] in judged else 2


def _refined(levels: Levels, space: SearchSpace, screened: Sequence[Fit], best: Fit) -> list[Fit]:
    """Return the best pairs, fitted again on the cells of the recording, the best score first.

    Screening cells confuse effects that delay or fade the plume in the same way. If a pair nearly
    closes the gap, more pairs are therefore refined.
    """
    pairs = close_to_best(_screened_pairs(levels, space, screened, best))[:WIDE_BEAM]
    refined = levels.refined(pairs[:BEAM], 0.36)
    if refined and normalised_misfit(refined[0]) < NEARLY_CLOSED_MISFIT:
        refined += levels.refined(pairs[BEAM:], 0.39)
    return sorted(refined, key=score)


def _screened_pairs(
    levels: Levels, space: SearchSpace, screened: Sequence[Fit], best: Fit
) -> list[Fit]:
    """Return fits of pairs on the screening cells, sorted by score with a penalty per parameter."""
    bases, with_all_partners = pair_bases(best, screened)
    pairs: Combinations = {}
    for index, base in enumerate(bases):
        levels.progress(f'pairs with {base.label}', 0.25 + 0.08 * index / len(bases))
        every = index < with_all_partners
        partners = best_partners(
            levels, space, base, screened, one_parameter=every, with_places=every
        )
        pairs |= combined_fits(levels, base, partners, pairs.keys())
    pairs |= relocated(levels, pairs)
    return sorted(
        pairs.values(),
        key=lambda fit: score(fit) * PENALTY_PER_PARAMETER ** len(fit.scaled_parameters),
    )


def relocated(
    levels: Levels,
    combinations: Mapping[frozenset[str], Fit],
    most: int = RELOCATED_PAIRS,
    instead: Sequence[str] = (),
) -> Combinations:
    """Return at `most` the best pairs or triples with a leak or a zone at another place.

    The place is found with the other members present: the one that was found before imitates the
    member that was missing then. The effects `instead` are tried at places of their own in place of
    the leak or the zone. A combination is kept as it is if no other place fits better.
    """
    found: Combinations = {}
    local = [fit for fit in combinations.values() if any(has_place(m.effect) for m in fit.members)]
    for fit in sorted(local, key=score)[:most]:
        for moved, base in each_left_out(levels, fit):
            if not has_place(moved.effect):
                continue
            levels.progress(f'another place of {moved.label}', 0.33)
            for effect in dict.fromkeys((moved.effect, *instead)):
                for start in place_starts(levels, effect, beside=base)[:RELOCATED_PAIRS]:
                    for key, other in combined_fits(levels, base, [start], ()).items():
                        known = found.get(key, combinations.get(key, other))
                        found[key] = min(other, known, key=score)
    return found


def each_left_out(levels: Levels, fit: Fit) -> Iterator[tuple[Candidate, Fit]]:
    """Yield each member of `fit`, the last one first, and the fit of the others as they are."""
    parts = fit.member_parameters
    for number in reversed(range(len(parts))):
        others = [*parts[:number], *parts[number + 1 :]]
        scaled = np.concatenate([other.scaled for other in others])
        members = [other.candidate for other in others]
        yield parts[number].candidate, levels.screening.evaluate(members, scaled)


def combined_fits(
    levels: Levels, base: Fit, partners: Sequence[Candidate], known: Collection[frozenset[str]]
) -> Combinations:
    """Return the fits of `base` with each of `partners` on the screening cells.

    Combinations that are `known` already, and fits with a leak at a pumping well, are left out.
    """
    return extended_fits(levels, base, [(partner,) for partner in partners], known)


def extended_fits(
    levels: Levels,
    base: Fit,
    additions: Sequence[Sequence[Candidate]],
    known: Collection[frozenset[str]],
) -> Combinations:
    """Return the fits of `base` with all effects of each of `additions`, like `combined_fits`."""
    chosen: dict[frozenset[str], Sequence[Candidate]] = {}
    for added in additions:
        key = member_labels((*base.members, *added))
        if key not in known:
            chosen.setdefault(key, added)

    def fitted(added: Sequence[Candidate]) -> Fit:
        return levels.screening.fit(
            (*base.members, *added),
            start=np.concatenate([base.scaled_parameters, *(one.first for one in added)]),
            coarse_steps=PAIR_COARSE_ITERATIONS,
            fine_steps=PAIR_FINE_ITERATIONS,
        )

    pairs = zip(chosen, levels.side_by_side(fitted, list(chosen.values())), strict=True)
    return {key: fit for key, fit in pairs if fit.is_feasible and not levels.has_leak_at_well(fit)}


def best_partners(
    levels: Levels,
    space: SearchSpace,
    base: Fit,
    screened: Sequence[Fit],
    *,
    one_parameter: bool = False,
    with_places: bool = False,
) -> list[Candidate]:
    """Return the partners of `base`, by the share of its residual that they explain.

    Args:
        levels: the levels of the recordings.
        space: effects of the search.
        base: one effect, or several.
        screened: fits of single effects on the screening cells.
        one_parameter: include all effects with one parameter that belong to no well.
        with_places: include effects with a place, at the place that fits best beside `base`.
    """
    partners = [
        candidate
        for rank, candidate in enumerate(_by_linear_gain(levels, base, screened))
        if rank < BEAM
        or candidate.effect in TRIED_IN_EVERY_PAIR
        or (one_parameter and len(candidate.parameters) == 1 and 'well' not in candidate.fixed)
    ]
    for effect in space.local_effects if with_places else ():
        partners.extend(place_starts(levels, effect, beside=base)[:1])
    return partners


def _by_linear_gain(levels: Levels, base: Fit, screened: Sequence[Fit]) -> list[Candidate]:
    """Return the `screened` effects without a place, the largest linear gain with `base` first.

    The gain is reduced by PARTNER_GAIN_PER_PARAMETER for every parameter.
    """
    fitter = levels.screening
    residuals = fitter.residuals(base.effects, SMOOTHING_WIDTH)
    own = fitter.responses(base.members, base.scaled_parameters)
    candidates = [fit.members[0] for fit in screened]
    others = [
        candidate
        for candidate in candidates
        if may_act(candidate, base.members) and not has_place(candidate.effect)
    ]

    def gain(candidate: Candidate) -> float:
        members = (*base.members, candidate)
        scaled = np.concatenate([base.scaled_parameters, candidate.first])
        added = fitter.responses(members, scaled, first=len(base.scaled_parameters))
        penalty = PARTNER_GAIN_PER_PARAMETER ** len(candidate.parameters)
        return linear_gain(residuals, own, added) * penalty

    gains = levels.side_by_side(gain, others)
    order = sorted(range(len(others)), key=lambda number: -gains[number])
    return [others[number] for number in order]


def linear_gain(
    residuals: Sequence[FloatArray], own: Sequence[FloatArray], added: Sequence[FloatArray]
) -> float:
    """Return the decrease of the sum of squares that `added` parameters allow, to first order.

    With the projection Q onto the complement of the `own` responses A, the residual r and the added
    responses B, it is |Q r|^2 - min over u of |Q r - Q B u|^2.

    Args:
        residuals: whitened residuals, (nt, nz', nx') per recording.
        own: responses of parameters that adapt anyway, (p, nt, nz', nx') per recording.
        added: responses of the added parameters, (q, nt, nz', nx') per recording.
    """
    a = np.concatenate([part.reshape(len(part), -1) for part in own], axis=1)
    b = np.concatenate([part.reshape(len(part), -1) for part in added], axis=1)
    r = np.concatenate([part.ravel() for part in residuals])
    basis, _ = np.linalg.qr(a.T)
    r = r - basis @ (basis.T @ r)
    b = b.T - basis @ (basis.T @ b.T)
    norms = np.linalg.norm(b, axis=0)
    b = b[:, norms > ROUND_OFF * max(float(norms.max(initial=0.0)), 1e-12)]
    if b.shape[1] == 0:
        return 0.0
    solution, *_ = np.linalg.lstsq(b, r, rcond=RIDGE)
    return float(r @ r - np.sum((r - b @ solution) ** 2))
