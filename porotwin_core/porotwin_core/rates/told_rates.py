"""Rates that a person tells: those that no pump runs at are refused, odd ones are asked about.

Page, operator and siblings ask here. The guard and the virtual rig judge setpoints on their own.
"""

import math

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.rate_periods import PUMP_ACCURACY, SAME_RATE, largest_rate
from porotwin_core.rates.wells import WellRates, net_rate, net_rate_words
from porotwin_core.rig import Rig

PLAUSIBLE_FACTOR = 2.0
"""Plausible rates are at most this multiple of the greatest rate in rig.yaml: a pump may be set by
hand beyond the limits of the twin, but a further digit is a slip of the hand."""

FAR_OFF = 3.0
"""Factor between a told and a fixed rate above which it is probably a slip of the unit."""


def greatest_rate_ml_h(rig: Rig) -> float:
    """Return the greatest plausible rate of a well of `rig` [ml/h]."""
    greatest = to_ml_h(largest_rate(rig))
    control = rig.control
    if control is None:
        return greatest
    fixed = math.fsum(abs(well.rate_ml_h) for well in control.fixed.values())
    total = min(control.max_total_rate_ml_h, len(control.wells) * control.max_rate_ml_h)
    return min(PLAUSIBLE_FACTOR * (fixed + total), greatest)


def refuse_impossible(rates: WellRates, rig: Rig) -> None:
    """Check that the pumps of `rig` can run at `rates` [m^3/s].

    Raises:
        InputError: a well is unknown, its rate is too large, or its pump runs backwards.
    """
    greatest = greatest_rate_ml_h(rig)
    for name, well in rates.items():
        if name not in rig.wells:
            raise InputError(f"well '{name}' is not in the rig; known: {', '.join(rig.wells)}")
        rate_ml_h = to_ml_h(well.rate)
        if not abs(rate_ml_h) <= greatest:
            raise InputError(
                f"well '{name}': {rate_ml_h:g} ml/h is not plausible; the pumps of rig "
                f"'{rig.name}' run at up to {greatest:g} ml/h; check the number and its unit"
            )
        if well.rate * _direction(name, rig) < 0.0 and abs(well.rate) > SAME_RATE:
            verb = 'takes water out' if rate_ml_h > 0.0 else 'puts water in'
            raise InputError(
                f"well '{name}': {rate_ml_h:g} ml/h has the wrong sign, it {verb}; "
                f'write {-rate_ml_h:g}'
            )


def _direction(well: str, rig: Rig) -> int:
    """Return 1 for a well that injects by rig.yaml, -1 for one that produces, else 0."""
    control = rig.control
    if control is None:
        return 0
    if well == control.producer:
        return -1
    if well in control.fixed:
        rate = control.fixed[well].rate_ml_h
        return (rate > 0.0) - (rate < 0.0)
    return int(well in control.wells)


def other_fluids(rates: WellRates, rig: Rig) -> dict[str, float]:
    """Return the concentration [-] of rig.yaml for the wells that inject another one."""
    if rig.control is None:
        return {}
    usual = {name: well.concentration for name, well in rig.control.fixed.items()}
    usual |= dict.fromkeys(rig.control.wells, 0.0)
    return {
        name: fluid
        for name, fluid in usual.items()
        if name in rates
        and rates[name].rate > SAME_RATE
        and not abs(rates[name].concentration - fluid) <= WRITTEN_ROUND_OFF
    }


def imbalance(rates: WellRates, rig: Rig) -> str:
    """Return in words by how much `rates` [m^3/s] do not balance; '' if they do, or need not.

    They need to where all sides of `rig` are closed, and where it has a producer.
    They never add up to zero exactly: pumps differ by `PUMP_ACCURACY`, and displays round.
    """
    net, pumped = net_rate(rates), math.fsum(abs(well.rate) for well in rates.values()) / 2.0
    if not rig.closed and (rig.control is None or rig.control.producer is None):
        return ''
    if abs(net) <= PUMP_ACCURACY * pumped + SAME_RATE * len(rates):
        return ''
    return net_rate_words(net)


def doubts_about(rates: WellRates, rig: Rig) -> list[str]:
    """Return a sentence for everything odd about the `rates` [m^3/s] of all wells of `rig`."""
    control = rig.control
    if control is None:
        return []
    doubts = [
        f'{name} at {to_ml_h(rates[name].rate):.1f} ml/h is above its limit of '
        f'{control.max_rate_ml_h:g} ml/h.'
        for name in control.wells
        if name in rates and to_ml_h(rates[name].rate - SAME_RATE) > control.max_rate_ml_h
    ]
    slack = to_ml_h(SAME_RATE)
    together = math.fsum(to_ml_h(rates[name].rate) for name in control.wells if name in rates)
    taken = math.fsum(-to_ml_h(rates[name].rate) for name in rates if name == control.producer)
    if not doubts and together - slack > control.most_total_ml_h:
        doubts.append(
            f'The control wells inject {together:.1f} ml/h together, more than '
            f'{control.most_total_words}.'
        )
    elif taken - slack > (control.max_producer_rate_ml_h or math.inf):
        doubts.append(
            f'{control.producer} takes out {taken:.1f} ml/h, more than its limit of '
            f'{control.max_producer_rate_ml_h:g} ml/h.'
        )
    for name, well in control.fixed.items():
        told = to_ml_h(rates[name].rate) if name in rates else 0.0
        if told and not 1 / FAR_OFF <= told / (well.rate_ml_h or 1.0) <= FAR_OFF:
            doubts.append(
                f'{name} runs at {well.rate_ml_h:g} ml/h all the time, not at {told:.1f}; are the '
                'rates in ml/h?'
            )
    if words := imbalance(rates, rig):
        others = net_rate({name: well for name, well in rates.items() if name != control.producer})
        more = f'; is {control.producer} at {to_ml_h(-others):.1f} ml/h?'
        doubts.append(f'The rates do not balance: {words}{more if control.producer else "."}')
    return doubts
