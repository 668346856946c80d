"""A check of finished maps in time: no map has far more tracer than its neighbours, or far less.

Pumps bring in tracer at their rates, and no more leaves than the fluid that they move. A map with
a jump of tracer up and down, or down and up, is from another time.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.units import ML
from porotwin_core.checks.mass_check import LEAST_SHARE
from porotwin_core.checks.well_check import Maps
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig

_PUMP_ERROR = 1.5
"""Real over described rates: pumps may be wrong, and tracer may be seen late [-]."""
_LEAST_JUMP = 0.1
"""Jump that no pump explains, over the largest volume of tracer [-]. Calibrated maps keep within a
few hundredths."""
_NAMED = 3
"""Photographs that a message names."""


class Jump(NamedTuple):
    """A map out of its course: its number, and tracer before, in and after it [m^3]."""

    number: int
    before: float
    held: float
    after: float


def jumps(maps: Maps, times: Sequence[float], rig: Rig, schedule: Schedule) -> list[Jump]:
    """Return the maps with more tracer than both neighbours, or less, beyond the rates of pumps.

    Only cells that all three maps know count.

    Args:
        maps: calibrated maps of concentration [-].
        times: their times [s], ascending.
        rig: the rig; its depth, porosity and size give the pore volume.
        schedule: the injected rates.
    """
    if len(times) < 3 or not schedule.rows:
        return []
    pores = rig.cell_pore_volume(rig.grid(*maps[0].shape[::-1]))
    found, most = [], 0.0
    before, now = maps[0], maps[1]
    for number in range(1, len(times) - 1):
        after = maps[number + 1]
        jump = Jump(number, *_held(before, now, after, pores))
        most = max(most, *jump[1:])
        found.append((_impossible(jump, times, schedule), jump))
        before, now = now, after
    limit = max(_LEAST_JUMP * most, LEAST_SHARE * float(pores.sum()))
    return [jump for volume, jump in found if volume > limit]


def jump_remark(
    maps: Maps, times: Sequence[float], names: Sequence[str], rig: Rig, schedule: Schedule
) -> str:
    """Return which photographs, by their `names`, are out of the course of the tracer; '' if none.

    `jumps` explains the other arguments.
    """
    found = jumps(maps, times, rig, schedule)
    if not found:
        return ''
    told = '; '.join(
        f'{names[one.number]} shows {one.held * ML:.3g} ml of tracer stock, the maps before and '
        f'after it {one.before * ML:.3g} and {one.after * ML:.3g} ml'
        for one in found[:_NAMED]
    )
    more = f'; and {len(found) - _NAMED} more' if len(found) > _NAMED else ''
    return (
        f'{told}{more}; the pumps cannot do that: were files swapped, was a clock changed, or is '
        'the light of a photograph wrong? compare the photographs with their times in imaging.csv'
    )


def _held(
    before: FloatArray, now: FloatArray, after: FloatArray, pores: FloatArray
) -> tuple[float, float, float]:
    """Return the tracer of three maps [m^3] in the cells that all of them know."""
    known = np.isfinite(before) & np.isfinite(now) & np.isfinite(after)
    volume = pores[known]
    first, second, third = (float((one[known] * volume).sum()) for one in (before, now, after))
    return first, second, third


def _impossible(jump: Jump, times: Sequence[float], schedule: Schedule) -> float:
    """Return the part of a jump that the pumps cannot do [m^3], of its smaller side."""
    start, middle, end = times[jump.number - 1 : jump.number + 2]
    rise, fall = jump.held - jump.before, jump.held - jump.after
    early, late = _moved(schedule, start, middle), _moved(schedule, middle, end)
    if rise > 0 and fall > 0:
        return min(rise - early.brought, fall - late.taken)
    return min(-rise - early.taken, -fall - late.brought)


class Moved(NamedTuple):
    """The most tracer that pumps bring in and take out in a time [m^3]."""

    brought: float
    taken: float


def _moved(schedule: Schedule, start: float, end: float) -> Moved:
    """Return the tracer within reach of the pumps from `start` to `end` [s]."""
    stock = fluid = produced = 0.0
    for low, high, rates in schedule.intervals(start, end):
        for well in rates.values():
            volume = (high - low) * well.rate
            stock += max(volume, 0.0) * well.concentration
            fluid += max(volume, 0.0)
            produced += max(-volume, 0.0)
    return Moved(_PUMP_ERROR * stock, _PUMP_ERROR * max(fluid, produced))
