"""Stamps of photographs and messages: seconds since 1970, or since the start of an experiment."""

import os
import time
from datetime import UTC, datetime, timedelta

from porotwin_core.basis.units import LONGEST_EXPERIMENT_S

SINCE_1970 = 1e9
"""Stamps below this [s], September 2001, are no times since 1970: a camera's clock was never set,
or the times count from the start of an experiment."""

SAME_PHOTOGRAPH_S = 0.5
"""Times of one photograph in several messages, of its forecast, and of a change of the rates at it
differ by at most this [s]: clocks of pumps and cameras agree no better."""

SAME_MOMENT_S = 1.0
"""Maps, photographs and times that a person gives belong together within this [s]."""

SAME_STAMP_S = 1e-3
"""Stamps that differ by less are the same [s]: photographs carry milliseconds."""


def time_in_words(stamp: float) -> str:
    """Return a stamp [s] as a date in UTC, or as h:mm:ss since the start of an experiment."""
    try:
        if stamp < SINCE_1970:
            return str(timedelta(seconds=round(stamp)))
        return datetime.fromtimestamp(stamp, UTC).strftime('%Y-%m-%d %H:%M:%S UTC')
    except (ValueError, OverflowError, OSError):
        return f'{stamp:g} s'


STEADY_CLOCK = 'POROTWIN_STEADY_CLOCK'
"""Environment variable with the start of this machine [s since 1970], as the launcher knows it: all
its nodes have one steady clock, also a node that starts again."""

MACHINE_START_S = float(
    os.environ.get(STEADY_CLOCK) or time.time() - time.clock_gettime(time.CLOCK_BOOTTIME)
)
"""The start of this machine [s since 1970] by its clock when the graph or this process started."""


def steady_time() -> float:
    """Return the time [s] since 1970 by a clock that goes on when this machine's clock is set."""
    return MACHINE_START_S + time.clock_gettime(time.CLOCK_BOOTTIME)


def set_ahead() -> int:
    """Return by how much this machine's clock was set ahead of the steady one [whole s]."""
    return round(time.time() - steady_time())


def steady_time_of(moment: float, now: float) -> float:
    """Return a time of this machine's clock or another one [s] on the steady clock.

    The clock that wrote it may be this machine's, and was perhaps set. The time that is nearer to
    `now` [s] counts.
    """
    return min(moment, moment - set_ahead(), key=lambda one: abs(now - one))


def believed_age(taken: float, now: float, validity: float, *, simulated: bool = False) -> float:
    """Return the age [s] of the photograph of a setpoint that has come at `now` [s].

    The guard has passed it, so an age that is negative or beyond the `validity` [s] tells of a
    camera with another clock than this machine: the photograph then counts as new. In `simulated`
    time there is one clock only, which a setpoint may overtake on its way: its age is negative.
    """
    age = now - taken
    return age if simulated or 0.0 < age < validity else 0.0


def believed_start(told: float | None, began: float | None, stamp: float) -> float:
    """Return the start of the experiment [s], for the use of a state whose `stamp` [s] is believed.

    The start that imaging has `told` counts if it is this state, or if the node was started in
    the middle of an experiment. A start from a photograph with a wrong stamp counts for nothing.

    Args:
        told: time of the first photograph, as imaging told it last [s]; None: it told none.
        began: the start that the node has believed so far [s]; None: it has used no state yet.
        stamp: of the state [s].
    """
    if began is not None and began < SINCE_1970 <= stamp:
        began = None  # time zero of a simulation, but a recording of a rig is replayed
    if told is not None:
        joined = began is None and 0.0 <= stamp - told <= LONGEST_EXPERIMENT_S
        if joined or abs(stamp - told) < SAME_STAMP_S:
            return told
    return stamp if began is None else min(began, stamp)
