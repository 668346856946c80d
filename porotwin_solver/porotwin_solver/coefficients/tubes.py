"""Tubes between pumps and wells: water that must leave before the tracer behind it.

A tube of the volume V moves what enters as a plug, so that a concentration that enters after the
volume Q was pumped leaves at the volume Q + V. A tube is full of water at first, and its water
rests with its pump.
"""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace

from porotwin_core.rates.wells import Schedule, ScheduleRow
from porotwin_solver.coefficients.physics import Physics


def through_tubes(schedule: Schedule, physics: Physics) -> Schedule:
    """Return `schedule` with the concentrations that leave the tubes of `physics`."""
    volumes = {name: volume for name, volume in physics.dead_volumes.items() if volume > 0.0}
    if not volumes:
        return schedule
    rows = [row for row in schedule.rows if row.well not in volumes]
    for well, volume in volumes.items():
        own = [row for row in schedule.rows if row.well == well]
        rows += _leaving(own, volume, physics.rate_factors.get(well, 1.0))
    return replace(schedule, rows=tuple(rows))


def _leaving(rows: Sequence[ScheduleRow], volume: float, factor: float) -> Iterator[ScheduleRow]:
    """Yield the `rows` of one well behind a tube of `volume` [m^3], at `factor` of their rates."""
    tube = deque([(volume, 0.0)])  # volumes and concentrations, the next to leave first
    ends = [row.time for row in rows[1:]] + [math.inf]
    for row, end in zip(rows, ends, strict=True):
        now, rate = row.time, factor * row.rate.rate
        if rate <= 0.0:
            yield row
            continue
        tube.append((rate * (end - now), row.rate.concentration))
        while now < end:
            part, concentration = tube[0]
            yield replace(row, time=now, rate=replace(row.rate, concentration=concentration))
            left = min(end, now + part / rate)
            if left < end:
                tube.popleft()
            else:
                tube[0] = (part - rate * (end - now), concentration)
            now = left
