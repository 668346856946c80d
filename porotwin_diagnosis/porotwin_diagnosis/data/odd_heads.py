"""Looks for oddities of the water levels beyond the open sides."""

from porotwin_core.rig import Rig
from porotwin_core.rig.oddities import remarks_about_heads
from porotwin_solver.effects.water_level import true_levels


def odd_heads(rig: Rig) -> list[str]:
    """Return a line for all that is odd where different heads drive water through `rig`.

    Its effects count. Where the heads of two sides jump in a corner, no rate between these sides
    can be trusted.
    """
    boundaries = true_levels(rig)
    if not boundaries.raised_heads:
        return []
    levelled = rig.model_copy(update={'boundaries': boundaries})
    return [str(remark) for remark in remarks_about_heads(levelled)]
