"""What a browser is told: a snapshot in the units and words of people, ready for JSON.

Numbers that are not finite become None: JSON has no word for them, and the page shows a dash.
"""

import math
from typing import Any

import numpy as np

from porotwin_core.rig import Rig
from porotwin_core.units import to_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_page.pictures import difference_limit, forecast_of
from porotwin_page.snapshot import (
    CyclePoint,
    Health,
    Level,
    Map,
    Observation,
    Setpoint,
    Snapshot,
    photo_interval,
)

CHANGE_ML_H = 0.05
"""Smaller differences are not worth an operator's hand [ml/h]."""

STALE_AFTER_INTERVALS = 3
INTERVAL_UNTIL_KNOWN = 30.0
"""Time between photographs taken until the second one came [s]."""

ML = 1e6
"""Millilitres in a cubic metre."""

Json = dict[str, Any]


def finite(value: float | None, digits: int = 6) -> float | None:
    """Return `value` to some significant digits, None unless it is a finite number."""
    if value is None or not math.isfinite(value):
        return None
    return float(f'{value:.{digits}g}')


def _ml_h(rates: WellRates | None, well: str) -> float | None:
    return finite(to_ml_h(rates[well].rate)) if rates is not None and well in rates else None


def rig_view(rig: Rig) -> Json:
    """Return what is drawn over the maps: sizes, wells and the disallowed zone, in metres."""
    return {
        'name': rig.name,
        'width_m': rig.width_m,
        'height_m': rig.height_m,
        'wells': [{'name': name, 'x_m': w.x_m, 'z_m': w.z_m} for name, w in rig.wells.items()],
        'zone_m': [list(point) for point in rig.control.disallowed_zone_m] if rig.control else [],
    }


def _role(rig: Rig | None, well: str, rate: WellRate) -> str:
    if rig is not None and rig.control is not None:
        if well in rig.control.fixed:
            return 'fixed'
        if well == rig.control.producer:
            return 'producer'
        if well in rig.control.wells:
            return 'control'
    return 'producer' if rate.rate < 0 else 'control'


def _at_the_pumps(snapshot: Snapshot) -> WellRates | None:
    """Return what the pumps are taken to do before the newest setpoint; None: not known.

    A person's word counts most. Pumps that report follow by themselves, so for them it is the
    setpoint before.
    """
    if snapshot.set_rates is not None:
        return snapshot.set_rates
    if snapshot.pumps_report and len(snapshot.setpoints) > 1:
        return snapshot.setpoints[-2].rates
    return None


def _remaining(setpoint: Setpoint, now: float | None) -> float | None:
    """Return how long a setpoint still holds [s], counted from its arrival."""
    if now is None or setpoint.arrival is None:
        return None
    return finite(setpoint.arrival + (setpoint.valid_until - setpoint.time) - now)


def setpoint_view(snapshot: Snapshot, setpoint: Setpoint, now: float | None) -> Json:
    """Return the newest setpoint in ml/h, and which wells differ from what is set."""
    before = _at_the_pumps(snapshot)
    wells = []
    for well, rate in setpoint.rates.items():
        asked = to_ml_h(rate.rate)
        was = before.get(well, WellRate()) if before is not None else None
        changed = was is None or abs(to_ml_h(was.rate) - asked) > CHANGE_ML_H
        wells.append(
            {
                'name': well,
                'role': _role(snapshot.rig, well, rate),
                'tracer': rate.concentration if rate.rate > 0 else 0.0,
                'rate_ml_h': finite(asked),
                'before_ml_h': _ml_h({well: was}, well) if was is not None else None,
                'measured_ml_h': _ml_h(snapshot.measured, well),
                'changed': changed,
            }
        )
    return {
        'sequence': setpoint.sequence,
        'reason': setpoint.reason,
        'remaining_s': _remaining(setpoint, now),
        'validity_s': finite(setpoint.valid_until - setpoint.time),
        'confirmed': snapshot.confirmed == setpoint.sequence,
        'pumps_report': snapshot.pumps_report and snapshot.set_rates is None,
        'wells': wells,
    }


def photo_view(snapshot: Snapshot, observation: Observation, steady: float) -> Json:
    """Return the newest photograph's time and whether it is too old to steer by."""
    interval = photo_interval(snapshot) or INTERVAL_UNTIL_KNOWN
    age = steady - observation.arrival
    return {
        'sequence': observation.sequence,
        'time_s': observation.map.time,
        'age_s': finite(age),
        'interval_s': finite(interval),
        'stale': snapshot.finished is None and age > STALE_AFTER_INTERVALS * interval,
        'calibrated': observation.calibrated,
        'noise': finite(observation.noise, 3),
        'remarks': list(observation.remarks),
    }


def _json_map(shown: Map) -> Json:
    return {'number': shown.number, 'time_s': shown.time}


def _map_view(shown: Map | None) -> Json | None:
    return _json_map(shown) if shown is not None else None


def maps_view(snapshot: Snapshot) -> Json:
    """Return which maps there are, by the number under which their pictures are found."""
    observed = snapshot.observation.map if snapshot.observation else None
    shown: Json = {
        'observed': _map_view(observed),
        'forecast': _map_view(forecast_of(snapshot)),
        'difference': None,
    }
    if observed is not None:
        seen = float(np.isfinite(observed.concentration).mean())
        shown['observed']['unseen_percent'] = finite(100 * (1 - seen), 2)
        if snapshot.difference is not None:
            limit = difference_limit(snapshot.difference)
            shown['difference'] = {**_json_map(observed), 'limit': limit}
    return shown


def health_view(name: str, said: Health, steady: float, *, finished: bool) -> Json:
    """Return one node's light and line.

    A node that left the graph is an error whatever it said, unless the experiment is over.
    """
    if said.present is False:
        level, words = ('quiet', 'ended') if finished else ('error', 'not running')
        return {'name': name, 'level': level, 'message': words, 'age_s': None}
    age = None if said.level is Level.QUIET else finite(steady - said.arrival, 3)
    return {'name': name, 'level': said.level.value, 'message': said.message, 'age_s': age}


_FIRST = {'error': 0, 'warn': 1}


def all_health(snapshot: Snapshot, steady: float) -> list[Json]:
    """Return every node, those with trouble first."""
    finished = snapshot.finished is not None
    lines = [
        health_view(name, said, steady, finished=finished) for name, said in snapshot.health.items()
    ]
    return sorted(lines, key=lambda line: _FIRST.get(line['level'], len(_FIRST)))


def point_view(point: CyclePoint) -> Json:
    """Return a point of the curves: percent, ml, s and ml/h over the time stamp [s]."""
    return {
        'time_s': point.time,
        'predicted_percent': finite(100 * point.prediction_error, 4),
        'corrected_percent': finite(100 * point.corrected_error, 4) if point.corrected else None,
        'zone_ml': finite(ML * point.disallowed_tracer, 4),
        'cycle_s': finite(point.cycle_duration, 4),
        'rates_ml_h': {well: finite(to_ml_h(rate.rate)) for well, rate in point.rates.items()},
    }


def history_view(snapshot: Snapshot, *, after: int) -> Json:
    """Return the points of the curves with number `after` and later, and always the last again.

    The last point may still change, when the setpoint of its photograph comes after its report.
    `begin` is the number of the first point sent: the browser replaces what it has from there on.
    `reset`: it drops everything, because another experiment began or it has nothing.
    """
    first = snapshot.history_end - len(snapshot.history)
    reset = after < snapshot.history_start or after < first or after > snapshot.history_end
    begin = first if reset else max(first, min(after, snapshot.history_end - 1))
    return {
        'reset': reset,
        'begin': begin,
        'end': snapshot.history_end,
        'points': [point_view(point) for point in snapshot.history[begin - first :]],
    }


def state_view(snapshot: Snapshot, *, now: float | None, steady: float) -> Json:
    """Return everything but the curves.

    Args:
        snapshot: what is known.
        now: time on the graph's clock [s]; None while there is none.
        steady: time on this machine's steady clock [s], for ages.
    """
    setpoint = snapshot.setpoints[-1] if snapshot.setpoints else None
    observation = snapshot.observation
    last = snapshot.history[-1] if snapshot.history else None
    return {
        'now_s': now,
        'start_s': snapshot.start,
        'finished': snapshot.finished,
        'rig': rig_view(snapshot.rig) if snapshot.rig else None,
        'photo': photo_view(snapshot, observation, steady) if observation else None,
        'setpoint': setpoint_view(snapshot, setpoint, now) if setpoint else None,
        'maps': maps_view(snapshot),
        'correction': last.correction_status if last else None,
        'corrected': last.corrected if last else None,
        'remarks': list(last.remarks) if last else [],
        'marks': [{'time_s': mark.time, 'reason': mark.reason} for mark in snapshot.marks],
        'health': all_health(snapshot, steady),
    }
