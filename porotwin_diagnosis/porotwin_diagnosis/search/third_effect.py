"""Three effects, where the best pair leaves more than a true one may.

A third effect is looked for beside the best pairs, two at once beside the best single effects, and
three at once beside none (`effects_at_once`): the best single effect may imitate all three.
The best pair is often an imitation: without the third effect a leak lies at a wrong place, so that
the true pair is never fitted. So pairs without a common effect get a third one too.

The partners of the pair are found like those of a single effect: by the part of its residual that
their linear response explains, and that its own parameters cannot imitate. The leak or the zone of
the best triples is then looked for again, because a linear response gives its place only roughly,
and a zone may stand for a leak. Other members are not exchanged: with so many parameters an
exchange soon finds an imitation. A triple has up to ten parameters, and is fitted until its misfit
falls no more.

Only a triple that earns its place is kept. It is compared with the pairs inside it too, because the
true pair may have been found only there.
"""

from collections.abc import Sequence

from porotwin_diagnosis.model.effect_traits import has_place
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.effect_pairs import (
    Combinations,
    best_partners,
    combined_fits,
    each_left_out,
    extended_fits,
    pair_bases,
    relocated,
)
from porotwin_diagnosis.search.effects_at_once import fitted_afresh, groups_beside
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Judgement, Levels
from porotwin_diagnosis.search.ranking import (
    earns_its_place,
    lack_of_fit,
    member_labels,
    normalised_misfit,
    score,
    surely_suffices,
)
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import (
    BEAM,
    COMBINATION_GAIN,
    CORRECTED_MISFIT,
    FAR_LESS,
    LEAST_REFIT_GAIN,
    PART_OF_A_TRIPLE,
    PENALTY_PER_PARAMETER,
    TIED_TRIPLE,
)


def judged_triples(levels: Levels, space: SearchSpace, findings: Findings) -> Judgement:
    """Return the judged triples that explain clearly more than the best of the pairs.

    The result is empty where the best pair suffices, or leaves so much that it is hardly part of
    the truth. Then the levels are unchanged.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    pairs, null = findings.pairs, findings.null
    if not pairs or surely_suffices(pairs[0]):
        return Judgement(levels, [])
    of_the_gap = PART_OF_A_TRIPLE * normalised_misfit(null)
    if normalised_misfit(pairs[0]) > max(CORRECTED_MISFIT, of_the_gap):
        return Judgement(levels, [])
    coarse = levels
    if score(pairs[0]) < CORRECTED_MISFIT:
        coarse = levels.with_corrected_coarse_cells(pairs[0].effects)
    best = distinct(_screened_triples(coarse, space, findings))[:BEAM]
    pair = coarse.refining.evaluate(pairs[0].members, pairs[0].scaled_parameters)
    judged = coarse.judged(hopeful(coarse.refined(best, 0.78), pair), 0.81)
    again = coarse.judged_again([_converged(coarse, fit) for fit in judged], null, 0.86)
    kept = worth_keeping(again.fits, pairs[0], null)
    return Judgement(again.levels if kept else levels, kept)


def judged_pairs_inside(levels: Levels, triples: Sequence[Fit], null: Fit) -> Judgement:
    """Return the judged pairs that the best of the `triples` contain, each fitted alone.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    pairs: Combinations = {}
    for triple in triples[:BEAM]:
        for _left_out, pair in each_left_out(levels, triple):
            pairs.setdefault(member_labels(pair.members), pair)
    judged = levels.judged(levels.refined(list(pairs.values()), 0.88), 0.88)
    return levels.judged_again(judged, null, 0.89)


def worth_keeping(triples: Sequence[Fit], pair: Fit, null: Fit) -> list[Fit]:
    """Return the judged `triples` that explain clearly more than the best `pair`."""
    gain = FAR_LESS if lack_of_fit(pair, null) <= 1.0 else COMBINATION_GAIN
    return [triple for triple in triples if earns_its_place(triple, pair, gain)]


def hopeful(refined: Sequence[Fit], pair: Fit) -> list[Fit]:
    """Return the `refined` triples that leave less than the best `pair` on the same cells."""
    return [fit for fit in refined if score(fit) < LEAST_REFIT_GAIN * score(pair)]


def _converged(levels: Levels, fit: Fit) -> Fit:
    """Return the judged `fit`, fitted again as long as its misfit falls clearly.

    The cells of the recording are corrected at `fit`: they then have the misfit of the judging
    cells, and its slopes at less cost.

    Raises:
        InputError: the model cannot run with `fit`.
    """
    for _ in range(BEAM):
        near = levels.with_corrected_coarse_cells(fit.effects)
        again = near.judged(near.refined([fit], 0.84), 0.85)
        if not again or score(again[0]) > LEAST_REFIT_GAIN * score(fit):
            break
        fit = again[0]
    return fit


def bases_of_triples(pairs: Sequence[Fit]) -> list[Fit]:
    """Return the judged `pairs` that get a third effect, the best first.

    No two of them share an effect, except with the best one: it may hold one true effect only.
    """
    bases = list(pairs[:1])
    for pair in pairs[1:]:
        labels = member_labels(pair.members)
        if all(labels.isdisjoint(member_labels(base.members)) for base in bases[1:]):
            bases.append(pair)
    return bases[:BEAM]


def distinct(triples: Sequence[Fit]) -> list[Fit]:
    """Return the `triples` of which no two share two effects, the best score first.

    A pair that imitates much would otherwise fill all places, each time with another third effect.
    Triples that coarse cells cannot tell apart are kept: those that differ in a leak and a zone,
    and one that is tied with the best. The score has a penalty per parameter, like that of pairs.
    """
    if not triples:
        return []
    first, *others = sorted(triples, key=_penalised)
    tied = [fit for fit in others if score(fit) <= TIED_TRIPLE * score(first)][:1]
    chosen = [first, *tied]
    for fit in others:
        if not any(fit is other or _nearly_the_same(fit, other) for other in chosen):
            chosen.append(fit)
    return sorted(chosen, key=_penalised)


def _nearly_the_same(one: Fit, other: Fit) -> bool:
    """Return whether two triples share two effects, and differ in more than a leak and a zone."""
    labels = member_labels(one.members), member_labels(other.members)
    if len(labels[0] & labels[1]) < 2:
        return False
    shared = labels[0] & labels[1]
    rest = [m for m in (*one.members, *other.members) if m.label not in shared]
    return not rest or not all(has_place(member.effect) for member in rest)


def _penalised(fit: Fit) -> float:
    return score(fit) * PENALTY_PER_PARAMETER ** len(fit.scaled_parameters)


def _screened_triples(levels: Levels, space: SearchSpace, findings: Findings) -> list[Fit]:
    """Return fits of three effects on the screening cells."""
    known = findings.screened
    triples: Combinations = {}
    for number, pair in enumerate(bases_of_triples(findings.pairs)):
        levels.progress(f'a third effect beside {pair.label}', 0.55 + 0.03 * number)
        base = levels.screening.evaluate(pair.members, pair.scaled_parameters)
        partners = best_partners(levels, space, base, known, with_places=True)
        triples |= combined_fits(levels, base, partners, triples.keys())
    singles, _ = pair_bases(findings.singles[0], known)
    for number, single in enumerate(singles[:BEAM]):
        levels.progress(f'two more effects beside {single.label}', 0.64 + 0.03 * number)
        couples = groups_beside(levels, space, single, known, 2)
        triples |= extended_fits(levels, single, couples, triples.keys())
    levels.progress('three effects at once', 0.73)
    at_once = groups_beside(levels, space, findings.screened_null, known, 3)
    for fit in fitted_afresh(levels, at_once, known):
        key = member_labels(fit.members)
        triples[key] = min(fit, triples.get(key, fit), key=score)
    local = [fit for fit in triples.values() if any(has_place(m.effect) for m in fit.members)]
    moved = {member_labels(fit.members): fit for fit in distinct(local)[:BEAM]}
    triples |= relocated(levels, moved, BEAM, space.local_effects)
    return list(triples.values())
