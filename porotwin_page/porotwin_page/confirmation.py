"""The operator's confirmation of rates, as a browser sends it.

A browser sends the rate of every well, so the record holds the rates that it showed. Impossible
rates are refused. For odd rates the page first asks the operator. A page that knows no rig leaves
both to the operator node.
"""

import math
from dataclasses import dataclass
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.remark import QUOTED
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.rate_periods import ROUND_OFF_ML_H
from porotwin_core.rates.told_rates import doubts_about, refuse_impossible
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_page.graph_snapshot import GraphSnapshot, Setpoint

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
    doubts = doubts_about(rates, snapshot.rig) if snapshot.rig is not None else []
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
    orders = (setpoint.rates, snapshot.safe_rates)
    rates = {
        well: _rate(well, given[well], [order[well] for order in orders if well in order])
        for well in setpoint.rates
    }
    if snapshot.rig is not None:
        refuse_impossible(rates, snapshot.rig)
    return rates


def _rate(well: str, value: object, orders: list[WellRate]) -> WellRate:
    """Return the rate of a well; a value that was ordered is that order, to the last digit."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not _is_finite(value):
        raise InputError(f"well '{well}': rate {_short(repr(value))} is not a number of ml/h")
    for order in orders:
        if abs(to_ml_h(order.rate) - value) <= ROUND_OFF_ML_H:
            return order
    return WellRate(from_ml_h(value), orders[0].concentration)


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False
