"""Values in the units and the form that browsers receive."""

import math
from typing import Any

from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.wells import WellRates

Json = dict[str, Any]


def finite(value: float | None, digits: int = 6) -> float | None:
    """Return `value` with so many significant digits; None (JSON null) if not finite."""
    if value is None or not math.isfinite(value):
        return None
    return float(f'{value:.{digits}g}')


def rates_ml_h(rates: WellRates) -> dict[str, float | None]:
    """Return rates [m^3/s] by well in ml/h."""
    return {well: finite(to_ml_h(rate.rate)) for well, rate in rates.items()}
