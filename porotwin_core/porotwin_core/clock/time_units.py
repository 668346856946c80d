"""Units of the times of an experiment for people: minutes, hours or days."""

from typing import NamedTuple


class TimeUnit(NamedTuple):
    """A unit of time with its `seconds`, its `name`, and the `decimals` that are written."""

    seconds: float
    name: str
    decimals: int

    def number(self, seconds: float) -> str:
        """Return `seconds` in this unit, without its name."""
        return f'{seconds / self.seconds:.{self.decimals}f}'

    def text(self, seconds: float) -> str:
        """Return `seconds` in this unit, with its name."""
        return f'{self.number(seconds)} {self.name}'

    def precise(self, seconds: float) -> str:
        """Return `seconds` to four digits in this unit, with its name."""
        return f'{seconds / self.seconds:.4g} {self.name}'


MINUTES = TimeUnit(60.0, 'min', 0)
HOURS = TimeUnit(3600.0, 'h', 1)
DAYS = TimeUnit(86400.0, 'd', 1)

LONGEST_IN_MINUTES, LONGEST_IN_HOURS = 10 * 3600.0, 5 * 86400.0
"""Longest experiments whose times are read in minutes and in hours [s]."""


def time_unit(duration: float) -> TimeUnit:
    """Return the unit for all times of an experiment that lasts `duration` [s]."""
    if duration <= LONGEST_IN_MINUTES:
        return MINUTES
    return HOURS if duration <= LONGEST_IN_HOURS else DAYS
