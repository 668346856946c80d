"""Proposed rates of the control wells, as a browser sends them to ask for their outlook."""

from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.rate_periods import SAME_RATE
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Control
from porotwin_page.graph_snapshot import GraphSnapshot


def parse_proposal(data: Any, snapshot: GraphSnapshot) -> dict[str, WellRate]:
    """Return the proposed rates of control wells [m^3/s] in `data`.

    Args:
        data: decoded JSON {"rates_ml_h": {well: rate}} with some or all control wells.
        snapshot: holds the rig with its limits.

    Raises:
        InputError: one line that names the fault; the rates break a limit of rig.yaml.
    """
    control = snapshot.rig.control if snapshot.rig is not None else None
    if control is None:
        raise InputError('proposal: this rig has no control wells')
    if not isinstance(data, dict) or set(data) != {'rates_ml_h'}:
        raise InputError('proposal: send a JSON object with rates_ml_h')
    given = data['rates_ml_h']
    if not isinstance(given, dict) or not given:
        raise InputError('rates_ml_h: send an object with the rate of one control well or more')
    rates = {well: _rate(well, value, control) for well, value in given.items()}
    _check_sum(rates, control)
    return rates


def _rate(well: str, value: object, control: Control) -> WellRate:
    if well not in control.wells:
        raise InputError(f"well '{well[:40]}' is no control well; {', '.join(control.wells)}")
    most = control.max_rate_ml_h
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= most:
        raise InputError(f"well '{well}': give a rate from 0 to {most:g} ml/h")
    return WellRate(from_ml_h(float(value)))


def _check_sum(rates: WellRates, control: Control) -> None:
    together = to_ml_h(sum(rate.rate for rate in rates.values()))
    if together > control.most_total_ml_h + to_ml_h(SAME_RATE):
        raise InputError(
            f'control wells inject {together:.1f} ml/h together; rig.yaml allows '
            f'{control.most_total_words}'
        )
