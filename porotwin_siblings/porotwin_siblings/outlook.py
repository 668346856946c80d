"""The expectations of all siblings together: bands, probabilities and maps."""

from dataclasses import dataclass

from porotwin_core.grid import FloatArray
from porotwin_core.wells import RateStep

BAND = (0.05, 0.5, 0.95)
"""Quantiles of a forecast: the ends of the 90 % band and the median."""


TIMES = 12
"""Times of an outlook: enough for a smooth curve. A sibling computes one step to each at least, so
that twice as many take twice as long."""


@dataclass(frozen=True)
class Outlook:
    """The expectations from `start` [s] on under a `plan` of rates over `horizon` [s].

    `times` [s] are after `start`. `zone_tracer` [m^3], `zone_area` [m^2] are (3, times): the ends
    of the 90 % band about the median, in the order of `BAND`. `zone_reached` (times,) is the share
    of siblings whose tracer has reached the zone by then. All three are NaN without a zone. `mean`
    and `deviation` are the maps (map times, nz, nx) [-] at `map_times` [s] after `start`. `ranked`
    are the numbers of the siblings in the order of their tracer in the zone, summed over all times.
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
