"""Two or three effects that are fitted together from the start.

A pair that grows from the best single effect misses the truth where that effect imitates two others
together. A lighter tracer in a shifted picture looked like a thin tracer, and neither of the two
fitted anything alone. So groups are also chosen by `joint_scan`, and fitted without a base.
"""

import math
from collections.abc import Sequence
from itertools import product

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.model.effect_traits import has_place
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.joint_scan import Group, may_act, promising_groups
from porotwin_diagnosis.search.levels import Judgement, Levels
from porotwin_diagnosis.search.ranking import effect_and_well, member_labels, score
from porotwin_diagnosis.search.single_effects import SearchSpace
from porotwin_diagnosis.thresholds import BEAM, COMBINATION_GAIN, WIDE_BEAM
from porotwin_solver.effects.definition.candidate import Candidate


def judged_couples(
    levels: Levels, space: SearchSpace, findings: Findings, pairs: Sequence[Fit]
) -> Judgement:
    """Return judged pairs of effects that were fitted together from the start.

    They must be clearly better than the best of the judged `pairs` with a base. Otherwise the
    levels stay unchanged, because a third effect is then looked for near that pair.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    levels.progress('two effects at once', 0.48)
    groups = groups_beside(levels, space, findings.screened_null, findings.screened, 2)
    fits = sorted(fitted_afresh(levels, groups, findings.screened), key=score)
    judged = levels.judged(levels.refined(fits[:BEAM], 0.49), 0.5)
    found = levels.judged_again(judged, findings.null, 0.51)
    limit = COMBINATION_GAIN * score(pairs[0]) if pairs else math.inf
    better = [fit for fit in found.fits if score(fit) < limit]
    return Judgement(found.levels if better else levels, better)


def groups_beside(
    levels: Levels, space: SearchSpace, base: Fit, screened: Sequence[Fit], size: int
) -> list[Group]:
    """Return the most promising groups of `size` effects beside `base`, which may have none.

    There are no groups if no simulation can tell.
    """
    members = {fit.members[0].label: fit.members[0] for fit in reversed(screened)}
    candidates = [
        member
        for member in members.values()
        if may_act(member, base.members) and not has_place(member.effect)
    ]
    try:
        return promising_groups(
            levels.screening.forwards,
            candidates,
            space.local_effects,
            size=size,
            beside=base,
            most=WIDE_BEAM,
            pool=levels.pool,
        )
    except InputError:
        return []


def fitted_afresh(levels: Levels, groups: Sequence[Group], screened: Sequence[Fit]) -> list[Fit]:
    """Return the fits of `groups` on the screening cells, from the first starts of their effects.

    Every variant of an effect is tried. The regression starts at small effects, and a fit that
    begins there may stay in a local minimum.
    """

    def variants(member: Candidate) -> list[Candidate]:
        if has_place(member.effect):
            return [member]
        same = (member.effect, member.fixed.get('well'))
        return [fit.members[0] for fit in screened if effect_and_well(fit) == same]

    chosen = {
        member_labels(members): members
        for group in groups
        for members in product(*map(variants, group))
    }
    fits = levels.side_by_side(levels.screening.fit, list(chosen.values()))
    return [fit for fit in fits if fit.is_feasible and not levels.has_leak_at_well(fit)]
