"""The rates of a rig without a command."""

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate, net_rate
from porotwin_core.rig import Rig


def safe_rates(rig: Rig) -> dict[str, WellRate]:
    """Return the rates without a command [m^3/s]: the fixed wells, balanced by the producer."""
    rates = {name: WellRate() for name in rig.wells}
    if rig.control is None:
        return rates
    for name, fixed in rig.control.fixed.items():
        rates[name] = WellRate(from_ml_h(fixed.rate_ml_h), fixed.concentration)
    if rig.control.producer is not None:
        rates[rig.control.producer] = WellRate(-net_rate(rates))
    return rates
