"""Tracer that is in the rig when a recording begins: the model starts with it.

A camera whose clock is late shows tracer in its first map as well. Then the rig was clean when the
pumps began, and the model must start clean, so that the effect `clock` can explain the map.
"""

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_core.wells import Schedule
from porotwin_diagnosis.data.observed_maps import (
    FILLED_SHARE,
    evenly_spread,
    filled_map,
    tracer_share,
)
from porotwin_diagnosis.data.plume_reach import tracer_beyond_reach
from porotwin_recording.recording import Recording

LONGEST_LATENESS = 0.15
"""Lateness of a clock, as a share of the recording, that is believed without further evidence. Half
of the recording would be no clock, but a recording that begins in the middle of an experiment."""

MOST_LATENESS = 0.3
"""The same where pauses and changes of the pumps show the lateness."""

LATENESS_STEPS = 60
"""Latenesses that are tried up to `MOST_LATENESS`: steps of 0.5 % of the recording."""

MOST_EXCESS = 3.0
"""Tracer in the first map over the tracer injected before it that a wrong porosity, depth or rate
may explain."""

MOST_WRONG = 1.5
"""The same for a late clock, either way."""

CLEARLY_BETTER = 0.7
"""Ratio of the errors of two courses of the tracer below which the better one is believed. While
one rate goes on, both courses are equal."""

SMALL_ERROR = 0.02
"""Error of a course, relative to the mean stock, that noise and the steps of the lateness make. It
is added to both errors."""

COMPARED_SHARE, COMPARED_MAPS = 0.7, 24
"""Share of the recording, and number of its maps, that both courses are compared with."""


def initial_tracer(recording: Recording) -> FloatArray | None:
    """Return the first map (nz, nx) [-] if it holds tracer that no known rate explains; else None.

    The rig has `held` [m^3] of stock in its first map. It is tracer from before the recording if

        held > MOST_EXCESS * V(before the map),

    where V is the volume of stock that the known rates inject, and if no late clock explains it.

    Raises:
        InputError: the recording holds no maps.
    """
    first, times = recording.present_maps[0], recording.times
    if tracer_share(first) < FILLED_SHARE:
        return None
    before = recording.delivered.injected_stock(-np.inf, times[0])
    held = _held(recording, 0)
    if held <= MOST_EXCESS * before or _is_late(recording, held):
        return None
    return filled_map(first, recording.grid)


def _is_late(recording: Recording, held: float) -> bool:
    """Return whether a late clock explains the `held` stock [m^3] of the first map.

    Two courses of the stock in the rig are compared with the maps: V(until t + lateness) of a late
    clock, and held + V(from the first map to t) of a rig with tracer. The better one is believed.
    If both are about equally good, the clock is believed up to `LONGEST_LATENESS`. No clock is
    believed if the map shows tracer where the stock injected until then cannot be.
    """
    times = np.array(recording.times)
    duration = times[-1] - times[0]
    early = np.flatnonzero(times <= times[0] + COMPARED_SHARE * duration)
    chosen = evenly_spread(early, COMPARED_MAPS)
    seen = np.array([_held(recording, int(index)) for index in chosen])

    def injected(at: FloatArray) -> FloatArray:
        return _injected(recording.delivered, at)

    start = injected(times[:1])
    from_start = np.abs(seen - held - injected(times[chosen]) + start).mean()
    possible = {
        share: np.abs(seen - injected(times[chosen] + share * duration)).mean()
        for share in np.linspace(0.0, MOST_LATENESS, LATENESS_STEPS + 1)
        if held / MOST_WRONG <= injected(times[:1] + share * duration)[0] <= held * MOST_WRONG
    }
    if not possible:
        return False
    share = min(possible, key=lambda tried: possible[tried])
    far = tracer_beyond_reach(recording, recording.delivered, times[0] + share * duration)
    if far.mean() > FILLED_SHARE:
        return False
    better = CLEARLY_BETTER if share > LONGEST_LATENESS else 1.0 / CLEARLY_BETTER
    small = SMALL_ERROR * float(seen.mean())
    return bool(possible[share] + small < better * (from_start + small))


def _held(recording: Recording, index: int) -> float:
    """Return the stock [m^3] in the map `index`."""
    shown = recording.present_maps[index]
    return float(np.nansum(shown * recording.rig.cell_pore_volume(recording.grid)))


def _injected(rates: Schedule, times: FloatArray) -> FloatArray:
    """Return the stock [m^3] that `rates` inject until each of the `times` (n,) [s]."""
    changes = [row.time for row in rates.rows if row.time < times.max()]
    knots = np.unique([*changes, times.min(), times.max()])
    volumes = [rates.injected_stock(-np.inf, float(knot)) for knot in knots]
    return np.interp(times, knots, volumes)
