"""Do the commanded rates keep to the control section of the rig, and to the steps of its pumps?"""

import math
from collections.abc import Iterator

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.rate_periods import PUMP_ACCURACY, ROUND_OFF_ML_H
from porotwin_core.rig import PUMP_STEP_ML_H

REMEDY = 'compare rates.csv with the control section of rig.yaml'
ROUND = 'round it, or correct rate_step_ml_h in rig.yaml if the pump takes it'


def _find(known: Known) -> Iterator[Remark]:
    """Yield remarks about wells, each once, the sum of the control wells, and their steps.

    A control well that injects tracer is not used as one. Nobody told the steps of a pump that has
    the default.
    """
    control, commanded = known.rig.control, known.commanded
    if control is None or commanded is None:
        return
    odd: dict[str, Remark] = {}
    off = []
    for row in commanded.rows:
        rate = to_ml_h(row.rate.rate)
        fixed, why = control.fixed.get(row.well), ''
        if fixed is not None and rate and row.rate.concentration == fixed.concentration:
            if not math.isclose(rate, fixed.rate_ml_h, rel_tol=PUMP_ACCURACY):
                why = f'control.fixed says {fixed.rate_ml_h:g} ml/h'
        elif row.well in control.wells and _exceeds(rate, control.max_rate_ml_h):
            why = f'control.max_rate_ml_h is {control.max_rate_ml_h:g} ml/h'
        elif row.well == control.producer and rate > 0.0:
            why = 'it is control.producer, which takes water out: is its minus missing?'
        elif row.well == control.producer and _exceeds(-rate, control.max_producer_rate_ml_h):
            why = f'control.max_producer_rate_ml_h is {control.max_producer_rate_ml_h:g} ml/h'
        if why:
            remark = Remark(f'rates.csv: well {row.well}', f'{rate:g} ml/h', why, REMEDY)
            odd.setdefault(row.well, remark)
        beside = abs(math.remainder(rate, control.rate_step_ml_h))
        is_told = control.rate_step_ml_h != PUMP_STEP_ML_H
        if is_told and row.well in control.wells and beside > ROUND_OFF_ML_H:
            off.append((row.time, f'{row.well} {rate:.6g} ml/h'))
    yield from odd.values()
    for time in dict.fromkeys(row.time for row in commanded.rows):
        rates = commanded.at(time)
        water = [rates[well] for well in control.wells if well in rates]
        total = math.fsum(to_ml_h(rate.rate) for rate in water if rate.concentration == 0.0)
        if _exceeds(total, control.max_total_rate_ml_h):
            key = f'rates.csv at {time:g} s: sum of the control wells'
            why = f'control.max_total_rate_ml_h is {control.max_total_rate_ml_h:g} ml/h'
            yield Remark(key, f'{total:g} ml/h', why, REMEDY, code='sum_of_rates')
            break
    if off:
        time, shown = off[0]
        more = f', like {len(off) - 1} more' if len(off) > 1 else ''
        why = f'no multiple of control.rate_step_ml_h {control.rate_step_ml_h:g}{more}'
        yield Remark(f'rates.csv at {time:g} s', shown, why, ROUND, code='rate_off_step')


def _exceeds(rate_ml_h: float, limit_ml_h: float | None) -> bool:
    """Return whether a rate is above a limit by more than a pump errs."""
    return rate_ml_h > (1.0 + PUMP_ACCURACY) * (limit_ml_h or math.inf)


CHECK = Check(needs=('commanded',), find=_find, explained_by=('odd_rate', 'two_rates'))
