"""What a browser sends when the operator is done, checked at the door."""

import math
from dataclasses import dataclass
from typing import Any

from porotwin_core.errors import InputError
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_page.snapshot import Setpoint, Snapshot


@dataclass(frozen=True)
class Confirmation:
    """Setpoint `sequence` was set; `rates` [m^3/s] only where they differ from what was asked."""

    sequence: int
    rates: WellRates


def _setpoint(snapshot: Snapshot, sequence: object) -> Setpoint:
    if isinstance(sequence, bool) or not isinstance(sequence, int):
        raise InputError(f'sequence {sequence!r}: send the whole number of a setpoint')
    for setpoint in snapshot.setpoints:
        if setpoint.sequence == sequence:
            return setpoint
    newest = (
        f'the newest is {snapshot.setpoints[-1].sequence}' if snapshot.setpoints else 'none yet'
    )
    raise InputError(f'setpoint {sequence} is not shown any more; {newest}')


def parse(data: Any, snapshot: Snapshot) -> Confirmation:
    """Return the confirmation in `data`: {sequence, rates_ml_h: {well: rate}}, rates optional.

    Raises:
        InputError: one line naming what is wrong.
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
