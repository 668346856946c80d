"""The rates that a plan announces: the one answer for all who announce, rehearse or run it.

A plan is `rig.yaml` with the announced pauses of its fixed wells, and `rates.csv` where there is
one. Setpoints hold fixed wells at the rates of `rig.yaml`, so that a `rates.csv` that is run under
control may let them rest, and pump nothing else.
"""

import math

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MINUTE_S, from_ml_h, to_ml_h
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.rate_periods import PUMP_ACCURACY, different_wells
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import Schedule, WellRate, WellRates
from porotwin_core.rig import Control, FixedWell, Rig


def uncontrolled_rates(rig: Rig) -> Schedule:
    """Return the rates [m^3/s] of `rig` without a setpoint, over the time of the experiment."""
    return FixedPauses.of(rig).in_schedule(Schedule.constant(safe_rates(rig)))


def safe_rates_at(rig: Rig, elapsed: float | None) -> WellRates:
    """Return the safe rates [m^3/s] with the pauses that are announced at a time.

    Args:
        rig: the rig.
        elapsed: time since the start of the experiment [s]; None: the start is not known, and the
            pauses of the first minute hold, as at the pumps.
    """
    return FixedPauses.of(rig).at(elapsed or 0.0, safe_rates(rig))


def with_plan(rig: Rig, plan: Schedule, source: str) -> Rig:
    """Return `rig` with the pauses that a `plan` of rates adds, and its end if `rig` has none.

    Args:
        rig: the rig; without a control section it stays as it is.
        plan: the rates [m^3/s]; those of control wells and producer say nothing here.
        source: the file of the plan, for errors.

    Raises:
        InputError: a well pumps at another rate or fluid than `rig` says.
    """
    control = rig.control
    if control is None or not plan.rows:
        return rig
    last = plan.rows[-1].time
    end = MINUTE_S * control.end_min if control.end_min is not None else last or math.inf
    _check_wells(control, plan, source)
    run = FixedPauses.of(rig).in_schedule(plan)
    pauses: dict[str, list[tuple[float, float]]] = {name: [] for name in control.fixed}
    for low, high, rates in run.intervals(0.0, min(end, LONGEST_EXPERIMENT_S)):
        for name, found in pauses.items():
            if rates.get(name, WellRate()).rate == 0.0:
                begin = found.pop()[0] if found and found[-1][1] == low else low
                found.append((begin, high))
    minutes = {
        name: tuple((low / MINUTE_S, high / MINUTE_S) for low, high in found)
        for name, found in pauses.items()
    }
    end_min = None if math.isinf(end) else end / MINUTE_S
    return rig.model_copy(update={'control': control.with_pauses(minutes, end_min)})


def _check_wells(control: Control, plan: Schedule, source: str) -> None:
    """Refuse a plan in which a well without a role pumps, or a fixed well at another rate."""
    for row in plan.rows:
        if row.rate.rate == 0.0 or row.well in control.wells or row.well == control.producer:
            continue
        told = f'{source}: {row.well} pumps {to_ml_h(row.rate.rate):g} ml/h at {row.time:g} s'
        well = control.fixed.get(row.well)
        if well is None:
            raise InputError(f'{told}, but has no role in control; add it to control.fixed')
        if different_wells({'': row.rate}, {'': _rate(well)}, accuracy=PUMP_ACCURACY):
            raise InputError(
                f'{told} (concentration {row.rate.concentration:g}); setpoints hold it at the '
                f'{well.rate_ml_h:g} ml/h (concentration {well.concentration:g}) of control.fixed: '
                'correct one of them'
            )


def _rate(well: FixedWell) -> WellRate:
    return WellRate(from_ml_h(well.rate_ml_h), well.concentration)
