"""Does the volume that the wells inject suit the rig?"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML
from porotwin_core.rates.wells import Schedule

MUCH_INJECTED = 100.0
"""Injected volume over the pore volume above which rates or times are probably wrong [-]."""

LITTLE_INJECTED = 0.01
"""Injected volume over the pore volume below which nothing can be seen of an experiment [-]."""

LITTLE = (
    'all wells inject {volume_ml:.3g} ml, {share:.2%} of the pore volume; were the rates in '
    'ml/min? Write ml/h, 60 times as much. Times in minutes? Write s'
)
MUCH = (
    'all wells inject {share:.3g} times the pore volume until {end_s:.4g} s; compare the last '
    'times and the rates with the protocol'
)


class Injected(NamedTuple):
    """What all wells inject [m^3], how much tracer stock is in it [m^3], until when [s]."""

    volume: float
    stock: float
    end: float


def injected(known: Known) -> Injected:
    """Return the volume of all wells until the `end`, by the delivered rates."""
    schedule, end = known.rates or Schedule(), known.end
    volume = math.fsum(
        (high - low) * max(well.rate, 0.0)
        for low, high, rates in schedule.intervals(0.0, end)
        for well in rates.values()
    )
    return Injected(volume, schedule.injected_stock(0.0, end), end)


def _find(known: Known) -> Iterator[Remark]:
    volume, _, end = injected(known)
    share = volume / known.rig.pore_volume
    facts = {'volume_ml': volume * ML, 'share': share, 'end_s': end}
    # a pulse of dye into the water of reservoirs is small
    if 0.0 < share < LITTLE_INJECTED and not known.rig.is_driven:
        yield Remark.of('rates.csv', 'little_injected', LITTLE, **facts)
    if share > MUCH_INJECTED:
        yield Remark.of('rates.csv', 'much_injected', MUCH, **facts)


CHECK = Check(needs=('rates',), find=_find, explained_by=('odd_rate',))
