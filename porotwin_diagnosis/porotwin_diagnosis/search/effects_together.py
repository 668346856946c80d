"""Fits of two or three effects together.

An effect that is looked for alone may imitate two others. So pairs are chosen near no effect and
near the best single effect, triples near the best pair, by the evidence of their linear responses
(`effect_sets`). They are screened, refined and judged like single effects. If none explains the
recording, the responses are taken at the best set, to exchange one of its effects.
"""

from collections.abc import Collection, Sequence

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.effect_sets import Extension, each_left_out, linear_sets
from porotwin_diagnosis.search.levels import Judgement, Levels
from porotwin_diagnosis.search.ranking import (
    earns_its_place,
    leaves_a_gap,
    member_labels,
    normalised_misfit,
    score,
)
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import (
    BEAM,
    CORRECTED_MISFIT,
    PART_OF_A_TRIPLE,
    WIDE_BEAM,
)

COARSE_ITERATIONS, FINE_ITERATIONS = 2, 3
"""Iterations of a fit on coarse and on fine residuals; it starts where the regression puts it."""

PROGRESS = {2: (0.25, 0.5), 3: (0.55, 0.85)}
"""Progress at the beginning and at the end of the search for sets, by their number of effects."""


def judged_together(
    levels: Levels, space: SearchSpace, bases: Sequence[Fit], null: Fit, size: int
) -> Judgement:
    """Return judged sets of `size` effects, the most plausible first.

    Args:
        levels: the levels of the recordings.
        space: effects of the search.
        bases: the fits near which sets are looked for, in this order, until a set leaves no gap;
            at last the best set itself, if it is close, to exchange one of its effects.
        null: the judged model without effects.
        size: number of effects.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    begin, end = PROGRESS[size]
    found = Judgement(levels, [])
    for number, base in enumerate((*bases, None)):
        if found.fits and not leaves_a_gap(found.fits[0]):
            break
        near = base or next((fit for fit in found.fits if score(fit) < CORRECTED_MISFIT), None)
        if near is None:
            break
        position = begin + (end - begin) * number / (len(bases) + 1)
        levels.progress(f'further effects beside {near.label}', position)
        coarse = found.levels
        if near.members and score(near) < CORRECTED_MISFIT:
            coarse = coarse.with_corrected_coarse_cells(near.effects)
        known = {member_labels(fit.members) for fit in found.fits}
        fits = sorted(_screened(coarse, space, near, size, known), key=score)
        refined = coarse.refined(fits[:WIDE_BEAM], position)
        again = coarse.judged_again(coarse.judged(refined, position), null, position)
        if again.fits:
            found = Judgement(again.levels, levels.ranked([*found.fits, *again.fits]))
    return found


def _screened(
    levels: Levels, space: SearchSpace, near: Fit, size: int, known: Collection[frozenset[str]]
) -> list[Fit]:
    """Return fits on the screening cells of sets of `size` effects near those of `near`.

    They have all of its effects, or all but one. Those that are `known` are left out.
    """
    try:
        every = linear_sets(levels, space, near)
    except InputError:
        return []
    chosen: dict[frozenset[str], Extension] = {}
    for sets in every:
        further = size - len(sets.kept.members)
        if further < 1:
            continue
        for one in sets.best(further, WIDE_BEAM if sets.kept is near else BEAM):
            chosen.setdefault(member_labels((*one.kept.members, *one.added)), one)

    def fitted(one: Extension) -> Fit:
        return levels.screening.fit(
            (*one.kept.members, *one.added),
            start=np.concatenate([one.kept.scaled_parameters, *(m.first for m in one.added)]),
            coarse_steps=COARSE_ITERATIONS,
            fine_steps=FINE_ITERATIONS,
            updated_slopes=True,
        )

    fits = levels.side_by_side(fitted, [one for key, one in chosen.items() if key not in known])
    return [fit for fit in fits if fit.is_feasible and not levels.has_leak_at_well(fit)]


def hopeful(pairs: Sequence[Fit], null: Fit) -> bool:
    """Return whether the best of the judged `pairs` is probably part of a triple.

    It leaves a gap, but not so much of the one of `null` that it is hardly part of the truth.
    """
    limit = max(CORRECTED_MISFIT, PART_OF_A_TRIPLE * normalised_misfit(null))
    return any(leaves_a_gap(pair) and normalised_misfit(pair) <= limit for pair in pairs[:1])


def judged_inside(levels: Levels, triples: Sequence[Fit], null: Fit) -> Judgement:
    """Return the judged pairs that the best of the `triples` contain, each fitted alone.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    pairs: dict[frozenset[str], Fit] = {}
    for triple in triples[:BEAM]:
        for pair, _ in each_left_out(levels, triple):
            pairs.setdefault(member_labels(pair.members), pair)
    judged = levels.judged(levels.refined(list(pairs.values()), 0.88), 0.88)
    return levels.judged_again(judged, null, 0.89)


def worth_keeping(triples: Sequence[Fit], pair: Fit) -> list[Fit]:
    """Return the judged `triples` that explain clearly more than the best `pair`."""
    return [triple for triple in triples if earns_its_place(triple, pair)]
