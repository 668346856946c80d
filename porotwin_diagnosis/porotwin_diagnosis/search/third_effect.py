"""A third effect beside the best pair, where the pair leaves more than a true one may.

The partners of the pair are found like those of a single effect: by the part of its residual that
their linear response explains, and that its own parameters cannot imitate. A pair is fitted without
the third effect, so that its leak or zone lies at a wrong place. Places are therefore looked for
again. Members are not exchanged: with so many parameters an exchange soon finds an imitation. Only
a triple that earns its place is returned.
"""

from collections import Counter
from collections.abc import Sequence

from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.effect_pairs import (
    Combinations,
    best_partners,
    combined_fits,
    relocated,
)
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Judgement, Levels
from porotwin_diagnosis.search.ranking import (
    close_to_best,
    earns_its_place,
    lack_of_fit,
    normalised_misfit,
    score,
)
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import (
    EXCHANGE_MISFIT,
    PAIRS_PER_EFFECT,
    REFINED_TRIPLES,
    RELOCATED_TRIPLES,
    TRIPLE_BASES,
)


def judged_triples(levels: Levels, space: SearchSpace, findings: Findings) -> Judgement:
    """Return the judged triples that explain clearly more than the best of the pairs.

    The result is empty where the best pair suffices, or leaves so much that it is hardly part of
    the truth. Then the levels are unchanged.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    pairs = findings.pairs
    if not pairs or lack_of_fit(pairs[0], findings.null) <= 1.0:
        return Judgement(levels, [])
    if normalised_misfit(pairs[0]) > EXCHANGE_MISFIT:
        return Judgement(levels, [])
    screened = _screened_triples(levels, space, distinct_pairs(pairs), findings.screened)
    best = close_to_best(sorted(screened.values(), key=score))[:REFINED_TRIPLES]
    judged = levels.judged(levels.refined(best, 0.88), 0.89)
    again = levels.judged_again(judged, findings.null, 0.9)
    kept = [triple for triple in again.fits if earns_its_place(triple, pairs[0])]
    return Judgement(again.levels if kept else levels, kept)


def _screened_triples(
    levels: Levels, space: SearchSpace, pairs: Sequence[Fit], screened: Sequence[Fit]
) -> Combinations:
    """Return fits of each of `pairs` with a third effect on the screening cells.

    A leak or a zone of the best ones is then looked for again: its place in the pair imitates the
    third effect.
    """
    triples: Combinations = {}
    for pair in pairs:
        levels.progress(f'a third effect beside {pair.label}', 0.88)
        base = levels.screening.evaluate(pair.members, pair.scaled_parameters)
        partners = best_partners(levels, space, base, screened, with_places=True)
        triples |= combined_fits(levels, base, partners, triples.keys())
    return triples | relocated(levels, triples, RELOCATED_TRIPLES)


def distinct_pairs(pairs: Sequence[Fit]) -> list[Fit]:
    """Return the judged `pairs` that get a third effect, the most plausible first.

    Each effect belongs to at most `PAIRS_PER_EFFECT` of them. Otherwise one effect that imitates
    much, such as a shifted picture, would be in all.
    """
    chosen: list[Fit] = []
    uses: Counter[str] = Counter()
    for pair in pairs:
        names = [member.effect for member in pair.members]
        if all(uses[name] < PAIRS_PER_EFFECT for name in names):
            uses.update(names)
            chosen.append(pair)
    return chosen[:TRIPLE_BASES]
