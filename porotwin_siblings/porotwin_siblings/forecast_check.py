"""How far forecasts of the plume in the zone missed it: the doubt that no sibling has.

The siblings agree on whatever their common model and the photographs have wrong. Such errors shift
the front, so that the area is wrong by the front's length times a distance. The length of a plume's
front grows as the root of its area, and the tracer behind it alike. The forecasts of the last half
hour tell the distance, and the bands widen by it (as in adaptive conformal prediction; Gibbs and
Candes, NeurIPS 2021).
"""

import math

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.effect_parameter import HALF_INTERVAL

CHECK_S = 300.0
"""Age of the forecasts that a photograph is compared with [s]."""

USUAL_AREA = 2e-3
"""Error of an area over the root of the area, before any photograph [m]: a front that is shifted by
some tenths of a millimetre. Found on six virtual rigs; others were used to count the coverage."""

USUAL_TRACER = 5e-5
"""Error of a volume of tracer over the root of the volume, before any photograph [m^1.5]."""

USUAL_WEIGHT = 4.0
"""Photographs that this first guess is worth."""

MEMORY = 0.93
"""Weight of earlier photographs beside the newest one."""

LEAST_AREA, LEAST_TRACER = 1e-4, 1e-7
"""Area [m^2] and volume of tracer [m^3] below which there is no front yet."""


class FadingSquare:
    """The mean square of errors. Earlier ones fade, and the usual one counts as some more."""

    def __init__(self, usual: float, weight: float, memory: float) -> None:
        """Know the `usual` error only, worth `weight` errors; each new one fades by `memory`."""
        self._usual, self._weight, self._memory = weight * usual**2, weight, memory
        self._squares = self._count = 0.0

    def add(self, square: float) -> None:
        """Take the square of an error."""
        self._squares = self._memory * self._squares + square
        self._count = self._memory * self._count + 1.0

    @property
    def mean(self) -> float:
        """The mean square."""
        return (self._usual + self._squares) / (self._weight + self._count)


class ForecastCheck:
    """Follows the errors of a quantity, in forecasts that are CHECK_S old."""

    def __init__(self, usual: float, least: float) -> None:
        """Know nothing yet.

        Args:
            usual: error over the root of the quantity, before any photograph.
            least: of the quantity; below it nothing is learnt.
        """
        self._usual, self._least = usual, least
        self._errors = FadingSquare(usual, USUAL_WEIGHT, MEMORY)

    def compare(self, expected: float, seen: float) -> None:
        """Take the quantity in the zone that was `expected`, and the one that is `seen`."""
        larger = max(expected, seen)
        if larger > self._least:  # without a zone both are NaN
            self._errors.add((seen - expected) ** 2 / larger)

    @property
    def error(self) -> float:
        """Error over the root of the quantity."""
        return math.sqrt(self._errors.mean)

    def widened(self, band: FloatArray, times: FloatArray) -> FloatArray:
        """Return a wider band.

        Args:
            band: low end, median and high end of the quantity, (3, times).
            times: ahead of the state [s], (times,).

        Returns:
            The same with the error of forecasts added to both sides. The variance of the usual
            error grows with time. A larger error has a cause that moves the front on and on, so
            that its deviation grows with time.
        """
        low, median, high = band
        growth = (times / CHECK_S).clip(1.0)
        usual = min(self.error, self._usual) ** 2
        variance = usual * growth + (self.error**2 - usual) * growth**2
        added = HALF_INTERVAL**2 * variance * median
        result = band.copy()
        result[0] = (median - ((median - low) ** 2 + added) ** 0.5).clip(0.0)
        result[2] = median + ((high - median) ** 2 + added) ** 0.5
        return result
