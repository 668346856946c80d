"""Checks whether rates from a person are plausible for the pumps of a rig."""

import math

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.plausibility import plausible_rate_ml_h
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig

PLAUSIBLE_FACTOR = 2.0
"""Plausible rates are at most this multiple of the greatest rate in rig.yaml: a pump may be set by
hand beyond the limits of the twin, but a further digit is a slip of the hand."""


def greatest_rate_ml_h(rig: Rig) -> float:
    """Return the greatest plausible rate of a well of `rig` [ml/h]."""
    greatest = plausible_rate_ml_h(rig.pore_volume)[1]
    control = rig.control
    if control is None:
        return greatest
    fixed = math.fsum(abs(well.rate_ml_h) for well in control.fixed.values())
    total = min(control.max_total_rate_ml_h, len(control.wells) * control.max_rate_ml_h)
    return min(PLAUSIBLE_FACTOR * (fixed + total), greatest)


def refuse_too_great(rates: WellRates, rig: Rig) -> None:
    """Check that the wells of `rates` [m^3/s] are in the rig and its pumps reach these rates.

    Raises:
        InputError: a well is unknown, or its rate is too large.
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
