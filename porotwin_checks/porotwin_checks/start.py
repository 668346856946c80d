"""The start of a recording: with a clean rig, or with tracer from before it.

A camera whose clock is late shows tracer in its first map as well. Then the rig was clean when the
pumps began, and the model must start clean, so that the effect `clock` can explain the map.

Two courses of the stock in the rig are compared with the maps, where V(t) is the volume of stock
that the known rates inject until the time t:

- V(t + lateness), if the rig was clean and the clock is late;
- held + V(t) - V(first map), if the rig held tracer before.

While one rate goes on, both courses are the same line. Pauses and changes of the pumps tell them
apart.
"""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_checks.known import MOST_MAPS, Known, Maps, stock_in_map
from porotwin_checks.tracer_errors import SCALE
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.held_out_share import held_out_begin
from porotwin_core.model.tracer_share import FILLED_SHARE, PLUME_THRESHOLD, tracer_share
from porotwin_core.rates.wells import Schedule
from porotwin_solver.effects import tracer_storage

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

CLEARLY_BETTER = 0.7
"""Ratio of the errors of two courses of the tracer below which the better one is believed. While
one rate goes on, both courses are equal."""

SMALL_ERROR = 0.02
"""Error of a course, relative to the mean stock, that noise and the steps of the lateness make. It
is added to both errors."""

REACH = 2.5
"""Reach of a plume over the radius of a disc of its volume [-]."""


class Start(Enum):
    """The content of a rig when its recording begins."""

    CLEAN = 'no tracer, or that of the known rates'
    LATE = 'no tracer, since the clock of the camera is late'
    LATE_OR_USED = 'the same, while tracer from before explains the maps about as well'
    USED = 'the tracer of the first map'


def start_of(known: Known) -> Start:
    """Return the start of the `known` maps.

    The rig has `held` [m^3] of stock in its first map. It is tracer from before the recording if

        held > MOST_EXCESS * V(first map),

    and if no late clock explains it (see `_Courses.late_clock_believed`).
    """
    maps, rates = known.maps, known.rates
    assert maps is not None and rates is not None
    before = rates.injected_stock(-np.inf, float(known.times[0]))
    held = stock_in_map(maps[0], known.rig)
    if tracer_share(maps[0]) < FILLED_SHARE or held <= MOST_EXCESS * before:
        return Start.CLEAN
    courses = _compared_courses(known, maps, rates)
    if courses is None or not courses.late_clock_believed:
        return Start.USED
    return Start.LATE if courses.clearly_late else Start.LATE_OR_USED


class _Courses(NamedTuple):
    """Mean errors [m^3] of the two courses of the stock, with `SMALL_ERROR`, and the lateness.

    `share` is the best lateness of the clock as a share of the recording.
    """

    of_late_clock: float
    of_used_rig: float
    share: float

    @property
    def clearly_late(self) -> bool:
        """Whether the course of a late clock fits the maps clearly better."""
        return self.of_late_clock < CLEARLY_BETTER * self.of_used_rig

    @property
    def late_clock_believed(self) -> bool:
        """Whether the clock is late: it fits clearly better, or about as well and is short."""
        if self.share > LONGEST_LATENESS:
            return self.clearly_late
        return CLEARLY_BETTER * self.of_late_clock < self.of_used_rig


def _compared_courses(known: Known, maps: Maps, rates: Schedule) -> _Courses | None:
    """Return how well both courses fit the maps.

    None if no lateness gives about the stock of the first map, or if that map shows tracer where
    the stock injected until then cannot be.
    """
    times, rig = np.array(known.times), known.rig
    duration = times[-1] - times[0]
    early = np.flatnonzero(times <= held_out_begin(times[0], times[-1]))
    chosen = early[np.linspace(0, len(early) - 1, min(len(early), MOST_MAPS)).round().astype(int)]
    seen = np.array([stock_in_map(maps[int(index)], rig) for index in chosen])
    held = stock_in_map(maps[0], rig)
    until_first = _injected(rates, times[:1])
    from_start = np.abs(seen - held - _injected(rates, times[chosen]) + until_first).mean()
    possible = {
        share: np.abs(seen - _injected(rates, times[chosen] + share * duration)).mean()
        for share in np.linspace(0.0, MOST_LATENESS, LATENESS_STEPS + 1)
        if held / SCALE <= _injected(rates, times[:1] + share * duration)[0] <= held * SCALE
    }
    if not possible:
        return None
    share = min(possible, key=lambda tried: possible[tried])
    far = tracer_beyond_reach(known, times[0] + share * duration)
    if far.mean() > FILLED_SHARE:
        return None
    small = SMALL_ERROR * float(seen.mean())
    return _Courses(float(possible[share]) + small, float(from_start) + small, float(share))


def _injected(rates: Schedule, times: FloatArray) -> FloatArray:
    """Return the stock [m^3] that `rates` inject until each of the `times` (n,) [s]."""
    changes = [row.time for row in rates.rows if row.time < times.max()]
    knots = np.unique([*changes, times.min(), times.max()])
    volumes = [rates.injected_stock(-np.inf, float(knot)) for knot in knots]
    return np.interp(times, knots, volumes)


def tracer_beyond_reach(known: Known, until: float) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of the first map with tracer that no well can have brought there.

    The stock that a well injects until the time `until` [s] fills a disc around it. Flow stretches
    the disc, so that `REACH` of its radius counts.
    """
    assert known.maps is not None and known.rates is not None
    rig, grid = known.rig, known.grid
    thickness = float(tracer_storage(rig, grid).mean()) / grid.cell_area
    x, z = np.meshgrid(grid.x, grid.z)
    far: NDArray[np.bool_] = np.nan_to_num(known.maps[0]) > PLUME_THRESHOLD
    for name in known.rates.wells:
        alone = Schedule(tuple(row for row in known.rates.rows if row.well == name))
        stock = alone.injected_stock(-np.inf, until)
        radius = math.sqrt(stock / (math.pi * thickness))
        well = rig.wells[name]
        far &= np.hypot(x - well.x_m, z - well.z_m) > REACH * radius
    return far
