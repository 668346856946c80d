"""Looks for oddities of the water levels beyond the open sides."""

from porotwin_core.rig import Rig
from porotwin_core.rig.checks.heads import remarks_about_heads
from porotwin_solver.effects.water_level import with_true_levels


def odd_heads(rig: Rig) -> list[str]:
    """Return a line for all that is odd where different heads drive water through `rig`.

    Its effects count. Where the heads of two sides jump in a corner, no rate between these sides
    can be trusted.
    """
    levelled = with_true_levels(rig)
    if not levelled.boundaries.raised_heads:
        return []
    return [str(remark) for remark in remarks_about_heads(levelled)]
