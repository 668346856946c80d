"""The rates to set with large numbers, their validity, and the button that confirms them.

The rates to set are those of a valid setpoint, and the safe rates after its expiry.
"""

import math

from porotwin_core.basis.units import MINUTE_S, ML, to_ml_h
from porotwin_core.rates.announced_rates import uncontrolled_rates
from porotwin_core.rates.bottle import bottle_at
from porotwin_core.rates.rate_periods import different_wells, same_by_hand
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.json_values import Json, finite
from porotwin_page.panel import Moment, Region, ScriptPanel


def setpoint_view(snapshot: GraphSnapshot, moment: Moment) -> Json | None:
    """Return the orders in ml/h with the wells to change; None before the first setpoint."""
    setpoint = snapshot.setpoint
    if setpoint is None:
        return None
    before = rates_before(snapshot)
    remaining = setpoint.remaining(moment.graph)
    expired = remaining is not None and remaining <= 0
    safe = expired and bool(snapshot.safe_rates)
    return {
        'sequence': setpoint.sequence,
        'time_s': finite(setpoint.time, 15),
        'reason': setpoint.reason,
        'remaining_s': finite(remaining),
        'validity_s': finite(setpoint.valid_until - setpoint.time),
        'expired': expired,
        'safe': safe,
        'next_change': next_change(snapshot, moment.graph),
        'bottle': bottle_view(snapshot, moment.graph),
        'doubt': setpoint.doubt,
        'confirmed': snapshot.confirmed == (setpoint.sequence, safe),
        'pumps_report': snapshot.pumps_report and snapshot.set_rates is None,
        'wells': [
            _well_view(well, rate, before, snapshot)
            for well, rate in snapshot.orders(moment.graph).items()
        ],
    }


def next_change(snapshot: GraphSnapshot, graph: float | None) -> Json | None:
    """Return the wells that next begin or end an announced pause, and in how many seconds.

    None without one, and before the start of the experiment is known.
    """
    pauses = snapshot.pauses
    moment = None if graph is None else min(pauses.moments(graph, math.inf), default=None)
    if graph is None or moment is None:
        return None
    before, after = pauses.resting(math.nextafter(moment, -math.inf)), pauses.resting(moment)
    return {
        'in_s': finite(moment - graph),
        'rest': sorted(after - before),
        'run': sorted(before - after),
    }


def bottle_view(snapshot: GraphSnapshot, graph: float | None) -> Json | None:
    """Return the tracer stock in its bottle by the announced rates, and when it is empty.

    It counts only until the end of the experiment. None if `rig.yaml` tells no volume, and before
    the start of the experiment is known.
    """
    rig, began = snapshot.rig, snapshot.began
    if rig is None or rig.control is None or began is None or graph is None:
        return None
    bottle = bottle_at(rig, uncontrolled_rates(rig), graph - began)
    end = MINUTE_S * (rig.control.end_min or math.inf)
    return bottle and {
        'left_ml': finite(ML * bottle.left),
        'empty_in_s': finite(bottle.empty_at - (graph - began)) if bottle.empty_at < end else None,
    }


def rates_before(snapshot: GraphSnapshot) -> WellRates | None:
    """Return the rates [m^3/s] at the pumps before the newest setpoint; None if unknown.

    Confirmed rates count. Without a confirmation, measuring pumps have followed the last setpoint.
    """
    if snapshot.set_rates is not None:
        return snapshot.set_rates
    if snapshot.pumps_report and len(snapshot.setpoints) > 1:
        return snapshot.setpoints[-2].rates
    return None


def _well_view(
    well: str, rate: WellRate, before: WellRates | None, snapshot: GraphSnapshot
) -> Json:
    was = None if before is None else before.get(well, WellRate())
    delivered = (snapshot.measured or {}).get(well)
    same = same_by_hand(snapshot.rig)
    return {
        'name': well,
        'tracer': rate.concentration if rate.rate > 0 else 0.0,
        'rate_ml_h': finite(to_ml_h(rate.rate)),
        'before_ml_h': finite(None if was is None else to_ml_h(was.rate)),
        'measured_ml_h': finite(to_ml_h(delivered.rate)) if delivered is not None else None,
        'changed': was is None or bool(different_wells({well: rate}, {well: was}, same=same)),
    }


PANEL = ScriptPanel(title='Pumps', region=Region.ACTIONS, order=10, view=setpoint_view)
