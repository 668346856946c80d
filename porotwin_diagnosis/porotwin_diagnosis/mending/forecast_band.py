"""A change test (CUSUM) on the errors of forecasts.

Page, Biometrika 41 (1954) 100-115: the sum of the excesses over an allowance, never below zero. One
bad photograph cannot reach the limit, because its score is bounded; a lasting change does.
"""

import math
import statistics

from scipy.stats import median_abs_deviation

LEARNING = 8
"""Photographs that give the usual error if no expected error is known."""

ALLOWANCE = 0.5
"""Excess per photograph that counts as chance, in standard deviations."""

LIMIT = 5.0
"""Sum of the excesses at which forecasts have left their band. With the allowance of a half, chance
reaches it once in 900 photographs (Montgomery, Statistical Quality Control, table 9.3)."""

MOST_SCORE = 3.0
"""Largest score of one photograph: a hand in front of the camera is no change of the rig."""

LEAST_DEVIATION = 0.15
"""Least standard deviation of the logarithm of an error: errors of forecasts of neighbouring
photographs differ by 15 % when nothing has changed."""


class ForecastBand:
    """Follows the relative errors of forecasts, one per photograph."""

    def __init__(self) -> None:
        """Know no error yet."""
        self._learnt: list[float] = []
        self._sum = 0.0

    def begin_anew(self) -> None:
        """Forget all errors, for a new model or experiment."""
        self._learnt.clear()
        self._sum = 0.0

    def left_by(self, error: float, expected: float = math.nan) -> bool:
        """Return whether the forecasts are worse than expected since this `error` [-].

        Args:
            error: relative L2 error of the forecast of a photograph; NaN without a forecast.
                An infinite one counts as a very bad one.
            expected: the error that follows from the deviations of map and forecast [-]; NaN if
                unknown: the first errors then give the usual error.
        """
        if not error > 0.0:
            return False
        score = self._score(math.log(error), expected) if math.isfinite(error) else MOST_SCORE
        if score is None:
            return False
        self._sum = max(0.0, self._sum + min(score, MOST_SCORE) - ALLOWANCE)
        if self._sum <= LIMIT:
            return False
        self._sum = 0.0
        return True

    def _score(self, log_error: float, expected: float) -> float | None:
        """Return the excess of an error in standard deviations; None while the usual is learnt."""
        if math.isfinite(expected) and expected > 0.0:
            return (log_error - math.log(expected)) / LEAST_DEVIATION
        if len(self._learnt) < LEARNING:
            self._learnt.append(log_error)
            return None
        usual = statistics.median(self._learnt)
        spread = float(median_abs_deviation(self._learnt, scale='normal'))
        return (log_error - usual) / max(spread, LEAST_DEVIATION)
