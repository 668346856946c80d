"""Do the commanded rates keep to the control section of the rig?"""

import math
from collections.abc import Iterator

from porotwin_checks.check import Check
from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import to_ml_h

SAME_RATE = 0.005
"""Relative difference of a rate from the described one that rounding of units makes."""

REMEDY = 'compare rates.csv with the control section of rig.yaml'


def _find(known: Known) -> Iterator[Remark]:
    yield from _wells(known)
    yield from _sum(known)


def _wells(known: Known) -> Iterator[Remark]:
    """Yield a remark for each well whose commanded rate the control section does not allow."""
    control = known.rig.control
    if control is None or known.commanded is None:
        return
    seen: set[str] = set()
    for row in known.commanded.rows:
        if row.well in seen:
            continue
        rate_ml_h = to_ml_h(row.rate.rate)
        where = f'rates.csv: well {row.well}'
        fixed = control.fixed.get(row.well)
        same = fixed is not None and math.isclose(rate_ml_h, fixed.rate_ml_h, rel_tol=SAME_RATE)
        chase = fixed is not None and row.rate.concentration != fixed.concentration
        if fixed is not None and rate_ml_h and not (same or chase):
            why = f'control.fixed says {fixed.rate_ml_h:g} ml/h'
        elif row.well in control.wells and rate_ml_h > control.max_rate_ml_h:
            why = f'control.max_rate_ml_h is {control.max_rate_ml_h:g} ml/h'
        else:
            continue
        seen.add(row.well)
        yield Remark(where, f'{rate_ml_h:g} ml/h', why, REMEDY)


def _sum(known: Known) -> Iterator[Remark]:
    """Yield a remark for the first time at which the control wells inject too much together.

    A control well that injects tracer is not used as one.
    """
    control = known.rig.control
    if control is None or known.commanded is None:
        return
    most = control.max_total_rate_ml_h
    for time in dict.fromkeys(row.time for row in known.commanded.rows):
        rates = known.commanded.at(time)
        water = [rates[well] for well in control.wells if well in rates]
        total = math.fsum(to_ml_h(rate.rate) for rate in water if rate.concentration == 0.0)
        if total > (1.0 + SAME_RATE) * most:
            yield Remark(
                f'rates.csv at {time:g} s: sum of the control wells',
                f'{total:g} ml/h',
                f'control.max_total_rate_ml_h is {most:g} ml/h',
                REMEDY,
                code='sum_of_rates',
            )
            return


CHECK = Check(needs=('commanded',), find=_find, explained_by=('odd_rate', 'two_rates'))
