"""Stamps of photographs and messages: seconds since 1970, or since the start of an experiment."""

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta

SINCE_1970 = 1e9
"""Stamps below this [s], September 2001, are no times since 1970: a camera's clock was never set,
or the times count from the start of an experiment."""


def time_in_words(stamp: float) -> str:
    """Return a stamp [s] as a date in UTC, or as h:mm:ss since the start of an experiment."""
    try:
        if stamp < SINCE_1970:
            return str(timedelta(seconds=round(stamp)))
        return datetime.fromtimestamp(stamp, UTC).strftime('%Y-%m-%d %H:%M:%S UTC')
    except (ValueError, OverflowError, OSError):
        return f'{stamp:g} s'


def steady_time() -> Callable[[], float]:
    """Return a clock [s] since 1970 that goes on steadily when this machine's clock is set."""
    epoch = time.time() - time.clock_gettime(time.CLOCK_BOOTTIME)
    return lambda: epoch + time.clock_gettime(time.CLOCK_BOOTTIME)


def believed_age(taken: float, now: float, validity: float) -> float:
    """Return the age [s] of the photograph of a setpoint that has come at `now` [s].

    The guard has passed it, so an age that is negative or beyond the `validity` [s] tells of a
    camera with another clock than this machine: the photograph then counts as new.
    """
    age = now - taken
    return age if 0.0 < age < validity else 0.0
