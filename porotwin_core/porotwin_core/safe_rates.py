"""The safe rates of a rig: what every well pumps while no setpoint is valid."""

from porotwin_core.rig import Rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate, net_rate


def safe_rates(rig: Rig) -> dict[str, WellRate]:
    """Return the rate of every well [m^3/s]: control wells off, fixed wells on, balanced.

    The producer takes out what the fixed wells inject. The result is empty for a rig without a
    control section.
    """
    control = rig.control
    if control is None:
        return {}
    rates = {name: WellRate() for name in rig.wells}
    for name, well in control.fixed.items():
        rates[name] = WellRate(from_ml_h(well.rate_ml_h), well.concentration)
    if control.producer is not None:
        rates[control.producer] = WellRate(-net_rate(rates))
    return rates
