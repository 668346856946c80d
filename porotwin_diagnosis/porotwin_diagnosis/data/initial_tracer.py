"""Tracer that is in the rig when a recording begins: the model starts with it.

A camera whose clock is late shows tracer in its first map as well. Then the rig was clean when the
pumps began, and the model must start clean, so that the effect `clock` can explain the map.

Two courses of the stock in the rig are compared with the maps, where V(t) is the volume of stock
that the known rates inject until the time t:

- V(t + lateness), if the rig was clean and the clock is late;
- held + V(t) - V(first map), if the rig held tracer before.

While one rate goes on, both courses are the same line. Pauses and changes of the pumps tell them
apart.
"""

from typing import NamedTuple

import numpy as np

from porotwin_core.checks.mass_check import stock_in_map
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_diagnosis.data.observed_maps import (
    FILLED_SHARE,
    evenly_spread,
    filled_map,
    tracer_share,
)
from porotwin_diagnosis.data.plume_reach import tracer_beyond_reach
from porotwin_recording.experiment.recording import Recording

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


class RecordingStart(NamedTuple):
    """What the rig holds when a recording begins.

    Attributes:
        tracer: the first map (nz, nx) [-] if it holds tracer that no known rate explains, or None.
        may_have_held_tracer: whether `tracer` is None because a late clock is believed, while
            tracer from before the recording explains the maps about as well.
    """

    tracer: FloatArray | None
    may_have_held_tracer: bool


CLEAN_START = RecordingStart(None, may_have_held_tracer=False)
"""The start of a rig without tracer."""


def start_of(recording: Recording) -> RecordingStart:
    """Return what the rig holds when `recording` begins.

    The rig has `held` [m^3] of stock in its first map. It is tracer from before the recording if

        held > MOST_EXCESS * V(first map),

    and if no late clock explains it (see `_Courses.late_clock_believed`).

    Raises:
        InputError: the recording holds no maps.
    """
    if not _has_unexplained_tracer(recording):
        return CLEAN_START
    courses = _compared_courses(recording)
    if courses is not None and courses.late_clock_believed:
        return RecordingStart(None, may_have_held_tracer=not courses.clearly_late)
    first = filled_map(recording.present_maps[0], recording.grid)
    return RecordingStart(first, may_have_held_tracer=False)


def initial_tracer(recording: Recording) -> FloatArray | None:
    """Return the tracer (nz, nx) [-] of `start_of`.

    Raises:
        InputError: the recording holds no maps.
    """
    return start_of(recording).tracer


def _has_unexplained_tracer(recording: Recording) -> bool:
    """Return whether the first map holds much more stock than was injected before it."""
    first = recording.present_maps[0]
    if tracer_share(first) < FILLED_SHARE:
        return False
    before = recording.delivered.injected_stock(-np.inf, recording.times[0])
    return stock_in_map(first, recording.rig) > MOST_EXCESS * before


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


def _compared_courses(recording: Recording) -> _Courses | None:
    """Return how well both courses fit the maps of `recording`.

    None if no lateness gives about the stock of the first map, or if that map shows tracer where
    the stock injected until then cannot be.
    """
    times, rates, rig = np.array(recording.times), recording.delivered, recording.rig
    duration = times[-1] - times[0]
    early = np.flatnonzero(times <= times[0] + COMPARED_SHARE * duration)
    chosen = evenly_spread(early, COMPARED_MAPS)
    maps = recording.present_maps
    seen = np.array([stock_in_map(maps[int(index)], rig) for index in chosen])
    held = stock_in_map(maps[0], rig)
    until_first = _injected(rates, times[:1])
    from_start = np.abs(seen - held - _injected(rates, times[chosen]) + until_first).mean()
    possible = {
        share: np.abs(seen - _injected(rates, times[chosen] + share * duration)).mean()
        for share in np.linspace(0.0, MOST_LATENESS, LATENESS_STEPS + 1)
        if held / MOST_WRONG
        <= _injected(rates, times[:1] + share * duration)[0]
        <= held * MOST_WRONG
    }
    if not possible:
        return None
    share = min(possible, key=lambda tried: possible[tried])
    far = tracer_beyond_reach(recording, rates, times[0] + share * duration)
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
