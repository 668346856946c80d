"""Whether the cores of plumes get steadily darker or paler from photograph to photograph.

Injected stock looks the same in every photograph. A hand or a shadow disturbs single photographs,
and a lamp or a moved camera makes one step. A core that goes on changing in one direction shows a
process in the rig, in the tracer, in the tube or in the light.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_imaging.calibrating.calibration_evidence import PhotographEvidence
from porotwin_imaging.settings import DEFAULTS, TrustSettings


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


def core_trend(
    photographs: Sequence[PhotographEvidence], settings: TrustSettings = DEFAULTS.trust
) -> CoreTrend | None:
    """Return the trend of the cores, None if they keep their level or change to and fro.

    Args:
        photographs: the evidence of each photograph, in the order of time.
        settings: noise of a core, and the number of levels that make a trend.
    """
    cored = [one for one in photographs if math.isfinite(one.core_level)]
    if not cored:
        return None
    trend = CoreTrend(cored[0], cored[-1])
    sign = 1.0 if trend.rises else -1.0
    levels = [sign * one.core_level for one in cored]
    if _rising_levels(levels, settings.core_noise) < settings.fewest_core_levels:
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
