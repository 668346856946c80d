"""The expectations of all siblings together: bands, probabilities and maps."""

from dataclasses import dataclass

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import RateStep

BAND = (0.05, 0.5, 0.95)
"""Quantiles of a forecast: the ends of the 90 % band and the median."""


TIMES = 12
"""Times of an outlook: enough for a smooth curve. A sibling computes one step to each at least, so
that twice as many take twice as long."""


MOST_ANSWERS, ANSWERED_S = 16, 2700.0
"""Most siblings that answer a question, and the horizon up to which so many do [s]. Their courses
take half a second of processor time. About a longer time fewer answer, so that it takes no longer:
a person moves a slider and waits."""

LEAST_ANSWERS = 8
"""Fewest siblings that answer: both ends of the band need one or two of their own."""


def answers(count: int, horizon: float) -> int:
    """Return how many of `count` siblings answer a question about `horizon` [s]."""
    share = min(1.0, ANSWERED_S / horizon)
    return min(count, max(LEAST_ANSWERS, int(MOST_ANSWERS * share)))


@dataclass(frozen=True)
class Outlook:
    """The expectations from `start` [s] on under a `plan` of rates over `horizon` [s].

    `times` [s] are after `start`. `zone_tracer` [m^3], `zone_area` [m^2] are (3, times): the ends
    of the 90 % band about the median, in the order of `BAND`. `zone_reached` (times,) is the share
    of siblings whose tracer has reached the zone by then. All three are NaN without a zone. `mean`
    and `deviation` are the maps (map times, nz, nx) [-] at `map_times` [s] after `start`. `ranked`
    are the numbers of those that were asked, in the order of their tracer in the zone, summed over
    all times.
    """

    start: float
    plan: tuple[RateStep, ...]
    horizon: float
    times: FloatArray
    zone_tracer: FloatArray
    zone_area: FloatArray
    zone_reached: FloatArray
    map_times: FloatArray
    mean: FloatArray
    deviation: FloatArray
    ranked: tuple[int, ...]

    def answers(self, start: float, plan: tuple[RateStep, ...], horizon: float) -> bool:
        """Return whether these are the expectations from `start` [s] on under this question."""
        return (self.start, self.plan, self.horizon) == (start, plan, horizon)
