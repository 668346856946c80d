"""The operator's confirmation of rates, as a browser sends it.

A browser sends the rate of every well, so the record holds the rates that it showed. Impossible
rates are refused. For odd rates the page first asks the operator.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.remark import QUOTED
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.plausible_rates import greatest_rate_ml_h
from porotwin_core.rates.rate_periods import ROUND_OFF_ML_H, SAME_RATE
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig
from porotwin_page.graph_snapshot import GraphSnapshot, Setpoint

UNKNOWN_RIG_FACTOR = 10.0
"""A rate above all that a setpoint pumps together, times this, is a mistake of typing."""

LEAST_BOUND_ML_H = 1000.0
"""Bound of plausible rates where the wells are all off and the rig is not known [ml/h]."""


BALANCE_ML_H = to_ml_h(SAME_RATE) + ROUND_OFF_ML_H
"""Round-off of one rate at a pump's display of 0.1 ml/h; allowed once per well [ml/h]."""


FAR_OFF = 3.0
"""Factor between an entered and a fixed rate above which it is probably a slip of the unit."""

KEYS = ('sequence', 'orders', 'rates_ml_h', 'sure')

ORDERS = ('setpoint', 'safe')
"""The rates to set in a browser: the setpoint, or the safe rates after its expiry."""


class ConfirmationDoubt(Exception):  # noqa: N818  it is a question to the operator
    """The rates are odd. The message is a question; `sure` in a confirmation answers yes."""


@dataclass(frozen=True)
class Confirmation:
    """The rates at the pumps after an operator has set them.

    Attributes:
        sequence: number of the setpoint.
        rates: rates of all wells [m^3/s].
        safe: whether the browser showed the safe rates, because the setpoint had expired.
        sure: whether the operator was asked about odd rates and said yes.
    """

    sequence: int
    rates: WellRates
    safe: bool = False
    sure: bool = False


def decoded(body: bytes) -> Any:
    """Return the JSON value in the body of a request.

    Raises:
        InputError: it is no JSON, repeats a key, or has an invalid number.
    """
    try:
        return json_value(
            body.decode('utf-8'), parse_constant=_no_number, object_pairs_hook=_unique_keys
        )
    except InputError:
        raise
    except ValueError:
        raise InputError('confirmation: not JSON; send an object of sequence, rates_ml_h') from None


def _no_number(text: str) -> Any:
    raise InputError(f'confirmation: {text} is not a number of ml/h')


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise InputError(f"confirmation: key '{_short(key)}' stands there twice")
        found[key] = value
    return found


def parse(data: Any, snapshot: GraphSnapshot) -> Confirmation:
    """Return the confirmation in `data`, checked against setpoint and rig of `snapshot`.

    Args:
        data: decoded JSON {"sequence": number, "orders": "setpoint" or "safe",
            "rates_ml_h": {well: rate}, "sure": true or false} with the rates of all wells; `orders`
            (default: setpoint) and `sure` (default: false) may be missing.
        snapshot: holds the newest setpoint, the only one that may be confirmed.

    Raises:
        InputError: one line that names the fault.
        ConfirmationDoubt: the rates are odd and `sure` is not true.
    """
    if not isinstance(data, dict):
        raise InputError('confirmation: send a JSON object with sequence and rates_ml_h')
    unknown = set(data) - set(KEYS)
    if unknown:
        raise InputError(
            f"confirmation: unknown key '{_short(min(unknown))}'; send {', '.join(KEYS)}"
        )
    sure = data.get('sure', False)
    if not isinstance(sure, bool):
        raise InputError(f'sure {_short(sure)}: send true or false')
    orders = data.get('orders', ORDERS[0])
    if orders not in ORDERS:
        raise InputError(f'orders {_short(repr(orders))}: send one of {", ".join(ORDERS)}')
    setpoint = _setpoint(snapshot, data.get('sequence'))
    rates = _rates(data.get('rates_ml_h'), setpoint, snapshot)
    doubts = _doubts(rates, snapshot.rig)
    if doubts and not sure:
        raise ConfirmationDoubt(f'{" ".join(doubts)} Are these the rates at the pumps?')
    return Confirmation(setpoint.sequence, rates, safe=orders == ORDERS[1], sure=sure)


def _short(value: object) -> str:
    try:
        text = str(value)
    except ValueError:  # a whole number of thousands of digits
        return 'with too many digits'
    return text if len(text) <= QUOTED else f'{text[:QUOTED]}…'


def _setpoint(snapshot: GraphSnapshot, sequence: object) -> Setpoint:
    if isinstance(sequence, bool) or not isinstance(sequence, int):
        raise InputError(f'sequence {_short(repr(sequence))}: send the whole number of a setpoint')
    newest = snapshot.setpoint
    if newest is None:
        raise InputError(f'setpoint {_short(sequence)} is not known; there was none yet')
    if sequence != newest.sequence:
        raise InputError(
            f'setpoint {_short(sequence)} is not the newest; '
            f'set and confirm setpoint {newest.sequence}'
        )
    return newest


def _rates(given: object, setpoint: Setpoint, snapshot: GraphSnapshot) -> dict[str, WellRate]:
    if not isinstance(given, dict):
        raise InputError('rates_ml_h: send an object with the rate of every well')
    for well in given:
        if well not in setpoint.rates:
            known = ', '.join(setpoint.rates)
            raise InputError(
                f"well '{_short(well)}' is not in setpoint {setpoint.sequence}; known: {known}"
            )
    missing = [well for well in setpoint.rates if well not in given]
    if missing:
        raise InputError(f'rates_ml_h: no rate of {", ".join(missing)}; send all rates')
    bound = plausible_bound_ml_h(setpoint.rates, snapshot.rig)
    orders = (setpoint.rates, snapshot.safe_rates)
    return {
        well: _rate(well, given[well], bound, [order[well] for order in orders if well in order])
        for well in setpoint.rates
    }


def _rate(well: str, value: object, bound: float, orders: list[WellRate]) -> WellRate:
    """Return the rate of a well; a value that was ordered is that order, to the last digit."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not _is_finite(value):
        raise InputError(f"well '{well}': rate {_short(repr(value))} is not a number of ml/h")
    if abs(value) > bound:
        raise InputError(
            f"well '{well}': {value:g} ml/h is beyond this rig, whose rates lie within "
            f'{bound:g} ml/h; type it again'
        )
    for order in orders:
        if abs(to_ml_h(order.rate) - value) <= ROUND_OFF_ML_H:
            return order
    return WellRate(from_ml_h(value), orders[0].concentration)


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def plausible_bound_ml_h(rates: WellRates, rig: Rig | None) -> float:
    """Return the largest plausible size of a rate [ml/h].

    The operator node has the same bound. While the page knows no `rig`, it is ten times the sum of
    the `rates` [m^3/s] over all wells.
    """
    if rig is not None:
        return greatest_rate_ml_h(rig)
    together = math.fsum(abs(to_ml_h(rate.rate)) for rate in rates.values()) / 2
    return max(UNKNOWN_RIG_FACTOR * together, LEAST_BOUND_ML_H)


def _doubts(rates: Mapping[str, WellRate], rig: Rig | None) -> list[str]:
    """Return a sentence for everything odd about `rates` [m^3/s] on `rig`."""
    if rig is None or rig.control is None:
        return []
    control = rig.control
    shown = {well: to_ml_h(rate.rate) for well, rate in rates.items()}
    injecting = {*control.wells, *(name for name, w in control.fixed.items() if w.rate_ml_h > 0)}
    doubts = [
        f'{well} injects, but {shown[well]:.1f} ml/h takes out.'
        for well in rates
        if well in injecting and shown[well] < 0
    ]
    doubts += [
        f'{well} is above its limit of {control.max_rate_ml_h:g} ml/h.'
        for well in control.wells
        if shown.get(well, 0.0) > control.max_rate_ml_h + BALANCE_ML_H
    ]
    doubts += [
        f'{name} runs at {well.rate_ml_h:g} ml/h all the time, but {shown[name]:.1f} ml/h is '
        'entered; are the rates in ml/h?'
        for name, well in control.fixed.items()
        if shown.get(name) and not 1 / FAR_OFF <= shown[name] / (well.rate_ml_h or 1.0) <= FAR_OFF
    ]
    if control.producer is not None and shown.get(control.producer, 0.0) > 0:
        doubts.append(f'{control.producer} takes out, but a rate without minus injects.')
    net = math.fsum(shown.values())
    balanced = rig.closed or control.producer is not None
    if balanced and abs(net) > BALANCE_ML_H * max(1, len(rates)):
        more = 'goes in than out' if net > 0 else 'comes out than goes in'
        doubts.append(f'The rates do not balance: {abs(net):.1f} ml/h more {more}.')
    return doubts
