"""Periods that several places share."""

POLL_S = 0.2
"""Period of looks during a short wait [s]: people notice no delay."""

HEARTBEAT_S = 1.0
"""Period of other looks, and of reports of health [s]: the customary rate of /diagnostics."""

LAST_SHARE = 0.3
"""Share of a recording, at its end, that judges models: no fit of a diagnosis uses it."""


def last_part_begin(first: float, last: float) -> float:
    """Return the begin of the part that judges models, of maps from `first` to `last` [s]."""
    return first + (1.0 - LAST_SHARE) * (last - first)
