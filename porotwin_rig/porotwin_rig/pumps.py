"""The pumps: what they deliver of what they are told."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from porotwin_core.wells import WellRate, WellRates
from porotwin_rig.effects import Effects


@dataclass(frozen=True)
class Pumps:
    """`delivery`: factor between the rate a well is told and what its flow meter then measures.

    Wells that are not named deliver exactly. In the paper (sec. 4) the producer's pump gave about
    1 % less than prescribed: `Pumps({'producer': 0.99})`.
    """

    delivery: Mapping[str, float] = field(default_factory=dict)

    def measured(self, told: WellRates) -> dict[str, WellRate]:
        """Return what the flow meters show while the wells are told `told`."""
        return {
            name: WellRate(well.rate * self.delivery.get(name, 1.0), well.concentration)
            for name, well in told.items()
        }


def true_rate_factor(effects: Effects, well: str, *, start: float, end: float) -> float:
    """Return the mean factor over [start, end] [s] by which a flow meter of `well` is wrong."""
    factor = 1.0
    for effect in effects.all('rate'):
        if effect['well'] == well:
            factor *= float(effect['factor'])
    for effect in effects.all('pump_drift'):
        if effect['well'] == well:
            factor *= max(0.0, 1.0 + float(effect['drift']) * 0.5 * (start + end))
    for effect in effects.all('pulsation'):
        if effect['well'] == well:
            turn = 2.0 * math.pi / float(effect['period'])
            swing = (math.cos(turn * start) - math.cos(turn * end)) / (turn * (end - start))
            factor *= max(0.0, 1.0 + float(effect['amplitude']) * swing)
    return factor
