"""Rates that a person says were set: are they plausible for this rig?"""

import math

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.plausible_rates import refuse_too_great
from porotwin_core.rates.wells import WellRates, net_rate, net_rate_words
from porotwin_core.rig import Rig

NET_SHARE = 0.05
"""Share of the injected water that may be missing at the producer without a question; the pumps of
the paper differ by 1 %."""


def refuse_implausible(rates: WellRates, rig: Rig) -> None:
    """Return if `rates` [m^3/s] can have been set at the pumps of `rig`.

    Raises:
        InputError: a well is not known, a rate is too great, or a pump runs the wrong way
                or with another fluid.
    """
    refuse_too_great(rates, rig)
    for name, well in rates.items():
        rate_ml_h = to_ml_h(well.rate)
        if rate_ml_h * _direction(name, rig) < 0.0:
            verb = 'takes water out' if rate_ml_h > 0.0 else 'puts water in'
            raise InputError(
                f"well '{name}': {rate_ml_h:g} ml/h has the wrong sign, it {verb}; "
                f'write {-rate_ml_h:g}'
            )
        fluid = _fluid(name, rig)
        if (
            rate_ml_h > 0.0
            and fluid is not None
            and abs(well.concentration - fluid) > WRITTEN_ROUND_OFF
        ):
            raise InputError(
                f"well '{name}' injects concentration {fluid:g} by rig.yaml, "
                f'not {well.concentration:g}'
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


def _fluid(well: str, rig: Rig) -> float | None:
    """Return the concentration that a well injects by rig.yaml; None: rig.yaml does not say."""
    if rig.control is None:
        return None
    if well in rig.control.fixed:
        return rig.control.fixed[well].concentration
    return 0.0 if well in rig.control.wells else None


def question_about(rates: WellRates, rig: Rig) -> str | None:
    """Return a question about the sum of `rates` [m^3/s], or None if they balance.

    Only a rig with a producer balances its wells.
    """
    if rig.control is None or rig.control.producer is None:
        return None
    producer = rig.control.producer
    net_ml_h = to_ml_h(net_rate(rates))
    injected = math.fsum(to_ml_h(well.rate) for well in rates.values() if well.rate > 0.0)
    if abs(net_ml_h) <= NET_SHARE * injected:
        return None
    rest = net_ml_h - to_ml_h(rates[producer].rate) if producer in rates else net_ml_h
    return (
        f'{net_rate_words(net_rate(rates))}; is {producer} at {-rest:.1f} ml/h? '
        'correct it, or confirm the same once more'
    )
