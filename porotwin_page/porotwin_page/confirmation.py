"""The operator's confirmation of a setpoint, as a browser sends it."""

import math
from dataclasses import dataclass
from typing import Any

from porotwin_core.errors import InputError
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_page.graph_snapshot import GraphSnapshot, Setpoint


@dataclass(frozen=True)
class Confirmation:
    """The rates at the pumps after an operator has set them.

    Attributes:
        sequence: number of the setpoint.
        rates: wells whose rates [m^3/s] differ from the setpoint.
    """

    sequence: int
    rates: WellRates


def _setpoint(snapshot: GraphSnapshot, sequence: object) -> Setpoint:
    if isinstance(sequence, bool) or not isinstance(sequence, int):
        raise InputError(f'sequence {sequence!r}: send the whole number of a setpoint')
    for setpoint in snapshot.setpoints:
        if setpoint.sequence == sequence:
            return setpoint
    newest = (
        f'the newest is {snapshot.setpoints[-1].sequence}' if snapshot.setpoints else 'none yet'
    )
    raise InputError(f'setpoint {sequence} is no longer shown; {newest}')


def parse(data: Any, snapshot: GraphSnapshot) -> Confirmation:
    """Return the confirmation in `data`, checked against the setpoints of `snapshot`.

    Args:
        data: decoded JSON {"sequence": number, "rates_ml_h": {well: rate}}; the rates are optional.
        snapshot: holds the setpoints that the operator may have seen.

    Raises:
        InputError: one line that names the fault.
    """
    if not isinstance(data, dict):
        raise InputError('confirmation: send a JSON object with sequence and rates_ml_h')
    unknown = set(data) - {'sequence', 'rates_ml_h'}
    if unknown:
        raise InputError(f"confirmation: unknown key '{min(unknown)}'; send sequence, rates_ml_h")
    setpoint = _setpoint(snapshot, data.get('sequence'))
    given = data.get('rates_ml_h', {})
    if not isinstance(given, dict):
        raise InputError('rates_ml_h: send an object of rates by well')
    rates: dict[str, WellRate] = {}
    for well, rate in given.items():
        if well not in setpoint.rates:
            known = ', '.join(setpoint.rates)
            raise InputError(
                f"well '{well}' is not in setpoint {setpoint.sequence}; known: {known}"
            )
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not math.isfinite(rate):
            raise InputError(f"well '{well}': rate {rate!r} is not a number of ml/h")
        rates[well] = WellRate(from_ml_h(rate), setpoint.rates[well].concentration)
    return Confirmation(setpoint.sequence, rates)
