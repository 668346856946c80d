"""The share of a rig that holds tracer: whether it is clean."""

import numpy as np

from porotwin_core.geometry.grid import FloatArray

TRACER_LEVEL = 0.3
"""Concentration [-] above which a cell clearly holds tracer, whatever the noise. Dye that remains
in the grains after an experiment is paler."""

PLUME_THRESHOLD = 0.1
"""Concentration [-] above which a cell belongs to the plume: well above the noise of clean sand,
and below any plume."""

FILLED_SHARE = 0.02
"""Share of cells with tracer above which a rig is not clean: more than wells and stray light."""


def tracer_share(concentration: FloatArray) -> float:
    """Return the share [-] of cells (nz, nx) with tracer; compare it with `FILLED_SHARE`."""
    return float(np.mean(concentration > TRACER_LEVEL))
