"""Can the readings of balances and manometers be right, and do they suit the rates?"""

from collections.abc import Iterator
from itertools import combinations
from math import hypot

from porotwin_checks.checks.measured_rates import MOST_RATIO
from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rates.wells import Schedule

UNIT_OR_SIGN = 'compare sign and unit; outflow_ml counts from the start, positive out of the sand'


def _find(known: Known) -> Iterator[Remark]:
    for one in known.readings:
        if one.port is not None and one.port == one.against:
            why, remedy = 'both of its ports are the same place', 'correct one of them'
            yield _remark(one, why, remedy, 'same_port')
        well = known.rig.wells.get(one.place)
        if known.rates is not None and well is not None and well.rate_prior_ml_h is None:
            yield from _beside_rates(one, known.rates)
    for one, other in combinations(known.readings, 2):
        same = all(
            getattr(one, name) == getattr(other, name)
            for name in ('time', 'kind', 'place', 'port', 'against')
        )
        if same and abs(one.value - other.value) > MOST_RATIO * hypot(
            one.deviation, other.deviation
        ):
            why = f'another reading of the same place and time is {_shown(other)}'
            yield _remark(one, why, 'remove the wrong one', 'two_readings')


def _beside_rates(one: GaugeReading, rates: Schedule) -> Iterator[Remark]:
    """Yield a remark if no pump makes the reading `one` at a well."""
    pumped = [
        (high - low) * at[one.place].rate
        for low, high, at in rates.intervals(0.0, one.time)
        if one.place in at
    ]
    if one.kind is GaugeKind.CONCENTRATION and min(pumped, default=0.0) >= 0.0:
        why = 'no water has left through this well until then'
        yield _remark(one, why, 'correct its place or its time', 'no_outflow')
    if one.kind is GaugeKind.OUTFLOW:
        out = -sum(pumped)
        off = not 1.0 / MOST_RATIO < (one.value / out if out else 0.0) < MOST_RATIO
        if off and abs(one.value - out) > MOST_RATIO * one.deviation:
            why = f'the rates let {out * ML:.4g} ml out of this well until then'
            yield _remark(one, why, UNIT_OR_SIGN, 'other_outflow')


def _remark(one: GaugeReading, why: str, remedy: str, code: str) -> Remark:
    key = f'observations.csv: {one.kind} at {one.where}, {one.time:g} s'
    return Remark(key, _shown(one), why, remedy, code=code)


def _shown(one: GaugeReading) -> str:
    return f'{one.value * one.kind.per_si:.4g}'


CHECK = Check(needs=('readings',), find=_find)
