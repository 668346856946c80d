"""Are the heads odd that the effects of rig.yaml make of its own?"""

from collections.abc import Iterator

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.checks.heads import remarks_about_heads
from porotwin_solver.effects.water_level import with_true_levels


def _find(known: Known) -> Iterator[Remark]:
    """Yield the remarks about changed heads; who reads rig.yaml tells those about its own."""
    try:
        levelled = with_true_levels(known.rig)
    except InputError:  # whoever uses the model tells it
        return
    if levelled.boundaries != known.rig.boundaries:
        yield from remarks_about_heads(levelled)


CHECK = Check(needs=('rig',), find=_find)
