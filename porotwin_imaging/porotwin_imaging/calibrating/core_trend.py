"""Whether the cores of plumes get steadily darker or paler from photograph to photograph.

Injected stock looks the same in every photograph. A hand or a shadow disturbs single photographs,
and a lamp or a moved camera makes one step. A core that goes on changing in one direction shows a
process in the rig, in the tracer, in the tube or in the light.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_imaging.calibrating.calibration_evidence import PhotographEvidence
from porotwin_imaging.calibrating.plume_core import CORE


@dataclass(frozen=True)
class TrustSettings:
    """When a calibration is refused, and when a user is told (`calibration_trust.py`).

    Porosity, depth and sorption of a rig are rarely known better than to 10 %, a pump log is.
    """

    most_mass_factor: float = 1.25
    """Largest ratio of tracer in the plume to injected tracer, either way [-]. The core gives the
    level of stock, so that the maps are right up to it; beyond it the log is of something else."""
    most_filled_factor: float = 1.15
    """The same for the pores that the plume fills, where no core tells the level of stock [-]. Then
    the pump log alone gives the scale, so that it must agree better. A plume too small for a core
    seems larger than it is."""
    told_mass_error: float = 0.03
    """Difference of tracer in the maps and in the pump log that is told [-]."""
    sure_deviations: float = 2.0
    """Standard deviations from which a difference is told [-]."""
    most_offset: float = 0.14
    """Largest tracer at the start of the pump log, relative to the injected [-]."""
    told_offset: float = 0.05
    """Tracer at the start of the pump log that is told [-]."""
    least_hollow: float = 0.6
    """Least signal at the injecting well relative to the level of the plume [-]."""
    least_followers: float = 0.6
    """Least share of photographs that agree with each other [-]."""
    fewest_core_levels: int = 4
    """Levels one after the other, each beyond the noise, that make a trend of the cores. A lamp or
    a moved camera makes two, before and after."""
    most_mass_misfit: float = 0.08
    """Largest scatter of the photographs about the pump log, relative to the injection [-]."""
    least_strongest: float = 0.85
    """Least concentration of the injected fluid, relative to stock [-]."""
    most_bend: float = 0.17
    """Largest deviation of the response from a straight line at half stock [-]; it may be exceeded
    by its standard deviation. A dye that bends as much in absorbance would lose a third of its
    effect from pale to stock. A tracer that fades bent an injection to 0.172 with a deviation of
    0.05, and the diagnosis of its maps named the decay."""
    most_bend_conflict: float = 0.08
    """Largest difference between the bend by fronts and that by all evidence [-]: three standard
    deviations. Where they agree it is below 0.025."""
    most_dilution_misfit: float = 0.1
    """Largest difference between known and imaged dilutions [-]. Mixing and light cause 0.03."""
    told_dilution_misfit: float = 0.04
    """Difference between known and imaged dilutions that is told [-]."""
    most_apart: float = 0.05
    """Largest distance of a plume from the wells that inject it, relative to the width of the rig
    [-]. Injected tracer begins at its well."""
    most_bow: float = 0.012
    """Largest depth of the frame in the middle of a side, relative to the size of the rig [-]. On
    the large FluidFlower it is 0.022 without the terms of curvature and 0.001 with them."""
    told_bend_deviation: float = 0.028
    """Error of the response at half stock that is told [-]."""


TRUST = TrustSettings()


@dataclass(frozen=True)
class CoreTrend:
    """The cores of an injection that change in one direction.

    Attributes:
        first: the first photograph with a core.
        last: the last photograph with a core.
    """

    first: PhotographEvidence
    last: PhotographEvidence

    @property
    def rises(self) -> bool:
        """Whether the cores get darker in time."""
        return self.last.core_level > self.first.core_level


def core_trend(photographs: Sequence[PhotographEvidence]) -> CoreTrend | None:
    """Return the trend of the cores, None if they keep their level or change to and fro.

    Args:
        photographs: the evidence of each photograph, in the order of time.
    """
    cored = [one for one in photographs if math.isfinite(one.core_level)]
    if not cored:
        return None
    trend = CoreTrend(cored[0], cored[-1])
    sign = 1.0 if trend.rises else -1.0
    levels = [sign * one.core_level for one in cored]
    # the deviation of a difference of two levels
    noise = TRUST.sure_deviations * math.sqrt(2.0) * CORE.level_error
    if _rising_levels(levels, noise) < TRUST.fewest_core_levels:
        return None
    return trend


def _rising_levels(levels: Sequence[float], noise: float) -> int:
    """Return how many of `levels` exceed all earlier ones beyond `noise`; 0 if one falls back."""
    count, reached, highest = 1, levels[0], levels[0]
    for level in levels[1:]:
        if level < highest - noise:
            return 0
        if level > reached + noise:
            count, reached = count + 1, level
        highest = max(highest, level)
    return count
