"""Logs on a 12-hour clock that writes neither am nor pm."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Literal

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.foreign_time import HALF_DAY_H

Clock = Literal['12h-am', '12h-pm']
"""A 12-hour clock without am and pm; its log begins in the first or second half of a day."""


def on_twelve_hours(times: Sequence[datetime], clock: Clock, where: str) -> list[datetime]:
    """Return the times of a 12-hour clock without am and pm, the earliest that never fall.

    Args:
        times: as written, in their order.
        clock: tells the half of the day of the first.
        where: file and column, for messages.

    Raises:
        InputError: an hour is above 12, or a time falls whichever half of the day it is of.
    """
    half = timedelta(hours=HALF_DAY_H)
    found: list[datetime] = []
    for time in times:
        morning = time - half if time.hour == HALF_DAY_H else time
        ways = [morning, morning + half]
        if time.hour > HALF_DAY_H or time.hour == 0:
            raise InputError(
                f'{where}: hour {time.hour} is none of a 12-hour clock; leave --clock out'
            )
        ways = ways if found else [ways[clock == '12h-pm']]
        later = [way for way in ways if not found or way >= found[-1]]
        if not later:
            raise InputError(f'{where}: {time} falls on a 12-hour clock too; correct it')
        found.append(later[0])
    return found


def may_be_of_twelve_hours(starts: Sequence[datetime], ends: Sequence[datetime | None]) -> bool:
    """Return whether all times may be of a 12-hour clock."""
    return all(0 < time.hour <= HALF_DAY_H for time in (*starts, *filter(None, ends)))


def rates_on_twelve_hours(
    path: Path,
    starts: Sequence[datetime],
    ends: Sequence[datetime | None],
    clock: Clock,
) -> tuple[list[datetime], list[datetime | None]]:
    """Return the times of a log on a 12-hour clock, in the order of its rows.

    Raises:
        InputError: they fall on such a clock too.
    """
    begun = on_twelve_hours(starts, clock, str(path))
    half = timedelta(hours=HALF_DAY_H)
    stopped: list[datetime | None] = []
    for start, written in zip(begun, ends, strict=True):
        ways = () if written is None else (written - half, written, written + half)
        stopped.append(next((way for way in ways if way > start), written))
    return begun, stopped
