"""Tracer that is in the rig when a recording begins: the model starts with it."""

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_diagnosis.data.observed_maps import FILLED_SHARE, filled_map, tracer_share
from porotwin_recording.recording import Recording

LONGEST_LATENESS = 0.15
"""Offset of a clock, as a share of the recording, that is believed. A camera that is late shows
tracer in its first map as well, and an effect `clock` must be able to explain it. Half of the
recording would be no clock, but a recording that begins in the middle of an experiment."""

MOST_EXCESS = 3.0
"""Tracer in the first map over the tracer injected before it that a wrong porosity, depth or rate
may explain."""


def initial_tracer(recording: Recording) -> FloatArray | None:
    """Return the first map (nz, nx) [-] if it holds tracer that no known rate explains; else None.

    The rig has `held` [m^3] of stock in its first map. It is tracer from before the recording if

        held > MOST_EXCESS * V(before the map) + V(LONGEST_LATENESS of the recording after it),

    where V is the volume of stock that the known rates inject.

    Raises:
        InputError: the recording holds no maps.
    """
    first, times = recording.present_maps[0], recording.times
    if tracer_share(first) < FILLED_SHARE:
        return None
    rates, start = recording.delivered, times[0]
    lateness = LONGEST_LATENESS * (times[-1] - start)
    explained = MOST_EXCESS * rates.injected_stock(-np.inf, start)
    explained += rates.injected_stock(start, start + lateness)
    held = float(np.nansum(first * recording.rig.cell_pore_volume(recording.grid)))
    return filled_map(first, recording.grid) if held > explained else None
