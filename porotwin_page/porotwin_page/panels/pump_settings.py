"""The newest setpoint with large numbers, its validity, and the button that confirms it."""

from porotwin_core.units import to_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_page.graph_snapshot import GraphSnapshot, Setpoint
from porotwin_page.json_values import Json, finite
from porotwin_page.panel import Moment, Region, ScriptPanel

SMALLEST_CHANGE_ML_H = 0.05
"""Smaller changes are below the resolution of a hand-set pump [ml/h]."""


def setpoint_view(snapshot: GraphSnapshot, moment: Moment) -> Json | None:
    """Return the newest setpoint in ml/h with the wells to change; None before the first one."""
    setpoint = snapshot.setpoint
    if setpoint is None:
        return None
    before = rates_before(snapshot)
    return {
        'sequence': setpoint.sequence,
        'reason': setpoint.reason,
        'remaining_s': remaining_validity(setpoint, moment.graph),
        'validity_s': finite(setpoint.valid_until - setpoint.time),
        'confirmed': snapshot.confirmed == setpoint.sequence,
        'pumps_report': snapshot.pumps_report and snapshot.set_rates is None,
        'wells': [
            _well_view(well, rate, before, snapshot) for well, rate in setpoint.rates.items()
        ],
    }


def rates_before(snapshot: GraphSnapshot) -> WellRates | None:
    """Return the rates [m^3/s] at the pumps before the newest setpoint; None if unknown.

    The report of a person counts. Without one, pumps that report have followed the setpoint before.
    """
    if snapshot.set_rates is not None:
        return snapshot.set_rates
    if snapshot.pumps_report and len(snapshot.setpoints) > 1:
        return snapshot.setpoints[-2].rates
    return None


def remaining_validity(setpoint: Setpoint, now: float | None) -> float | None:
    """Return the remaining validity [s], counted from the arrival of the setpoint.

    Args:
        setpoint: the setpoint.
        now: present time on the graph's clock [s]; None if it has not started.

    Returns:
        Negative values after the end of the validity; None without a clock.
    """
    if now is None or setpoint.arrival is None:
        return None
    return finite(setpoint.arrival + (setpoint.valid_until - setpoint.time) - now)


def _well_view(
    well: str, rate: WellRate, before: WellRates | None, snapshot: GraphSnapshot
) -> Json:
    commanded = to_ml_h(rate.rate)
    was = None if before is None else to_ml_h(before.get(well, WellRate()).rate)
    measured = snapshot.measured.get(well) if snapshot.measured is not None else None
    return {
        'name': well,
        'tracer': rate.concentration if rate.rate > 0 else 0.0,
        'rate_ml_h': finite(commanded),
        'before_ml_h': finite(was),
        'measured_ml_h': finite(to_ml_h(measured.rate)) if measured is not None else None,
        'changed': was is None or abs(was - commanded) > SMALLEST_CHANGE_ML_H,
    }


PANEL = ScriptPanel(title='Pumps', region=Region.ACTIONS, order=10, view=setpoint_view)
