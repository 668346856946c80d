"""The rates that pumps deliver if they deliver a constant share of the commanded rates.

A laboratory knows this share by some percent only. The hub learns it; siblings take its word.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from porotwin_core.rates.wells import WellRate, WellRates, net_rate
from porotwin_core.rig import Rig

RATE_DEVIATION = 0.06
"""Standard deviation of the log of a pump's rate factor before any photograph: pumps of a
laboratory deliver a few percent off; one in a hundred is off by 15 %."""

MEMORY_S = 7200.0
"""Time in which earlier photographs fade by 1/e [s]: pumps and tubes change over hours."""

WINDOW_S = 900.0
"""Length of the course that a photograph is compared with [s]. Short: a pump wrong by some percent
has not moved the plume by a cell. Long: unknown causes have piled up."""


class PumpFactor(NamedTuple):
    """Delivered over commanded rate [-] and its standard deviation [-].

    `metered` is the part of the factor that a meter tells [-]: measured rates hold it already.
    """

    factor: float
    deviation: float
    metered: float

    @property
    def unmetered(self) -> float:
        """Delivered over measured rate [-]; over the commanded one of a pump without a meter."""
        return self.factor / self.metered


USUAL_PUMP = PumpFactor(1.0, RATE_DEVIATION, 1.0)
"""What is believed of a pump before any photograph."""


def rate_deviations(rig: Rig) -> dict[str, float]:
    """Return the deviation of the log of each rate factor before any photograph, by well."""
    return {
        name: (well.believed_rate_ml_h or (0.0, RATE_DEVIATION))[1]
        for name, well in rig.wells.items()
    }


def delivered(
    rates: WellRates, factors: Mapping[str, float], *, closed: bool = False
) -> dict[str, WellRate]:
    """Return the delivered rates [m^3/s] for commanded `rates`.

    In a `closed` rig, with four closed sides, the producing wells take out all injected water,
    whatever rate their pumps have.

    Args:
        rates: as commanded.
        factors: delivered over commanded rate by well; 1 where absent.
        closed: whether all sides of the rig are closed.
    """
    result = {
        name: replace(well, rate=well.rate * factors.get(name, 1.0)) for name, well in rates.items()
    }
    excess = net_rate(result)
    if not closed or excess == 0.0:
        return result
    produced = math.fsum(well.rate for well in result.values() if well.rate < 0.0)
    if produced == 0.0:
        return {name: replace(well, rate=0.0) for name, well in result.items()}
    share = 1.0 - excess / produced
    return {
        name: WellRate(well.rate * share) if well.rate < 0.0 else well
        for name, well in result.items()
    }
