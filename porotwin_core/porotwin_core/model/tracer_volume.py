"""The volume of tracer by pumps and photographs, and the causes of a difference between them.

A photograph may show a few per cent too much tracer, always by the same factor: its scale. A pump
may deliver another share of its rate, from some photograph on. The first changes all tracer from
the start on, the second each increment since its onset. Each `TracerCourse` is one explanation: a
Kalman filter of the volume, the scale and the delivered share, with its onset and its likelihood.
The estimate is their mean, weighted by likelihood (detection of change points; Fearnhead and Liu,
J. R. Stat. Soc. B 69 (2007) 589-605).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.delivered_rates import RATE_DEVIATION

CHANGE_LOG_ODDS = 8.0
"""Log of the odds against a change of delivery between two photographs, and of the ratio of
likelihoods that proves one. One in 3000: a pump stops once in many experiments, and an experiment
has hundreds of photographs."""

CHANGED_SHARE = 1.0
"""Standard deviation of a change of the delivered share [-]: a pump stops, or it is set to twice
its rate."""

LEAK_SHARE = 0.04
"""Standard deviation of the share of all tracer that a leak takes between two photographs [-]."""

RESPONSE_SHARE = 0.25
"""Error of a shown volume that is no error of scale, over the systematic deviation: the bend of the
response."""

LEAST_RESPONSE = 0.01
"""Least such error, relative to the shown volume [-]."""

MOST_SCALE = 2.0
"""Largest believed error of scale, in systematic deviations [-]; a wrong pump is likelier than a
larger one."""

OUTLIER_DEVIATIONS = 4.0
"""A difference counts as at most so many standard deviations: bubbles and reflections are none of
the prediction's errors."""

MOST_COURSES = 16
"""Explanations that are followed at a time; the likeliest ones stay."""


class Balance(NamedTuple):
    """The volume of tracer in a photograph and a prediction.

    Attributes:
        found: volume in the photograph, over the cells that count [m^3].
        predicted: the same of the prediction [m^3].
        shown: the systematic deviation of `found` [m^3].
        noise: variance of `found` by random errors [m^6].
        unseen: volume of the prediction in the other cells [m^3].
        injected: tracer that the pumps were told to inject since the last photograph [m^3].
        assumed: share of it that the prediction injected [-].
        deviation: standard deviation of that share [-].
    """

    found: float
    predicted: float
    shown: float
    noise: float
    unseen: float
    injected: float = 0.0
    assumed: float = 1.0
    deviation: float = RATE_DEVIATION

    @property
    def looks_at(self) -> FloatArray:
        """How much of a course's error the photograph shows, and its error by its scale, (3,)."""
        whole = self.predicted + self.unseen
        return np.array([self.predicted / whole if whole > 0.0 else 1.0, self.shown, 0.0])

    @property
    def scales(self) -> tuple[float, float]:
        """Range of believed errors of scale, in systematic deviations [-]."""
        most = MOST_SCALE * self.shown / self.found if self.found > 0.0 else 0.0
        return -MOST_SCALE / max(1.0 - most, 0.5), MOST_SCALE / (1.0 + most)

    @property
    def response(self) -> float:
        """Variance of `found` by the bend of the response [m^6]."""
        return max(RESPONSE_SHARE * self.shown, LEAST_RESPONSE * self.found) ** 2

    @property
    def lost(self) -> float:
        """Standard deviation of the tracer that a leak takes between two photographs [m^3]."""
        return LEAK_SHARE * max(self.found, self.predicted)


@dataclass(frozen=True)
class TracerCourse:
    """One explanation of all photographs so far.

    Attributes:
        mean: error of the estimated volume [m^3], of the scale of the photographs in their
            systematic deviations, and the share of its rate that the tracer's pump delivers, (3,).
        covariance: of these, (3, 3).
        log_weight: log of its probability.
        since: photographs since the delivery changed last; None: the pump delivers as others learn.
        tight: whether tracer comes and goes by wells only.
    """

    mean: FloatArray
    covariance: FloatArray
    log_weight: float = 0.0
    since: int | None = None
    tight: bool = True

    def branches(self) -> tuple['TracerCourse', 'TracerCourse']:
        """Return the course whose delivery changes now, and the one that has a leak from now on."""
        covariance = self.covariance.copy()
        covariance[2] = covariance[:, 2] = 0.0
        covariance[2, 2] = CHANGED_SHARE**2
        log_weight = self.log_weight - CHANGE_LOG_ODDS
        return (
            TracerCourse(self.mean, covariance, log_weight, since=0),
            replace(self, log_weight=log_weight, tight=False),
        )

    def advanced(self, balance: Balance) -> 'TracerCourse':
        """Return the course at the next photograph, before it is looked at.

        Others learn the share of a pump that goes on as ever, so that it stays as doubtful as they
        tell (a consider filter; Schmidt, 1966). With a leak the volume follows the photographs.
        """
        mean, covariance = self.mean.copy(), self.covariance
        if not self.tight:
            covariance = covariance + np.diag([balance.lost**2, 0.0, 0.0])
        since = self.since
        if since is not None:
            since += 1
        else:
            mean[2] = balance.assumed
            covariance = _with_share(covariance, balance.deviation)
        step = np.eye(3)
        step[0, 2] = balance.injected
        mean[0] += (mean[2] - balance.assumed) * balance.injected
        return TracerCourse(mean, step @ covariance @ step.T, self.log_weight, since, self.tight)

    def updated(self, balance: Balance) -> 'TracerCourse':
        """Return the course after the photograph of `balance`."""
        looks_at = balance.looks_at
        left = balance.found - balance.predicted - float(looks_at @ self.mean)
        noise = balance.noise + balance.response
        known = float(looks_at @ self.covariance @ looks_at)
        noise = max(noise, (left / OUTLIER_DEVIATIONS) ** 2 - known)
        expected = known + noise
        gain = self.covariance @ looks_at / expected
        if self.since is None:
            gain[2] = 0.0
        mean = self.mean + gain * left
        keep = np.eye(3) - np.outer(gain, looks_at)
        covariance = keep @ self.covariance @ keep.T + noise * np.outer(gain, gain)
        excess = mean[1] - float(np.clip(mean[1], *balance.scales))
        if excess != 0.0:
            mean = mean - excess * covariance[1] / covariance[1, 1]
        log_weight = self.log_weight - 0.5 * (left**2 / expected + math.log(expected))
        return replace(self, mean=mean, covariance=covariance, log_weight=log_weight)


@dataclass(frozen=True)
class Volume:
    """The estimated volume of tracer.

    `scale` is the error of the photographs, in their systematic deviations; `covariance` (3, 3) is
    that of the volume [m^3], of the scale, and of the delivered share of the tracer's pump.
    `share` is the mean of that share. `courses` are the explanations behind them, the likeliest
    first.
    """

    scale: float
    covariance: FloatArray
    share: float
    courses: tuple[TracerCourse, ...] = ()

    @property
    def since(self) -> int | None:
        """Photographs since the delivery changed last, by the likeliest course; None: never."""
        return self.courses[0].since if self.courses else None

    @classmethod
    def begun(cls, balance: Balance) -> 'Volume':
        """Return the volume after a first photograph with this `balance`."""
        covariance = np.zeros((3, 3))
        variance = balance.shown**2 + balance.noise + balance.response
        covariance[:2, :2] = [[variance, -balance.shown], [-balance.shown, 1.0]]
        return cls(0.0, covariance, 1.0, (TracerCourse(np.array([0.0, 0.0, 1.0]), covariance),))

    @property
    def surplus(self) -> float:
        """The mean over all courses, minus the estimated volume [m^3]."""
        return sum(math.exp(course.log_weight) * float(course.mean[0]) for course in self.courses)

    def updated(self, balance: Balance) -> 'Volume':
        """Return the volume after a photograph, its error relative to the prediction."""
        started = [*self.courses, *self.courses[0].branches()]
        courses = [course.advanced(balance).updated(balance) for course in started]
        courses.sort(key=lambda course: -course.log_weight)
        return _mixed(courses[:MOST_COURSES])

    def taken(self, volume: float) -> 'Volume':
        """Return the volume after the estimate has taken `volume` [m^3] of its error."""
        shift = np.array([volume, 0.0, 0.0])
        courses = tuple(replace(course, mean=course.mean - shift) for course in self.courses)
        return replace(self, courses=courses)


def _mixed(courses: Sequence[TracerCourse]) -> Volume:
    """Return the volume by all `courses`, with their weights normalised."""
    logs = np.array([course.log_weight for course in courses])
    logs = logs - logs.max()
    logs -= math.log(float(np.sum(np.exp(logs))))
    weights = np.exp(logs)
    means = np.array([course.mean for course in courses])
    mean = weights @ means
    inner = np.einsum('c,cij->ij', weights, np.array([course.covariance for course in courses]))
    spread = (means - mean).T @ (weights[:, None] * (means - mean))
    kept = tuple(
        replace(course, log_weight=float(log)) for course, log in zip(courses, logs, strict=True)
    )
    return Volume(float(mean[1]), inner + spread, float(mean[2]), kept)


def _with_share(covariance: FloatArray, deviation: float) -> FloatArray:
    """Return the `covariance` (3, 3) of a course with another `deviation` of the pump's share."""
    before = math.sqrt(covariance[2, 2])
    if before == 0.0:
        changed = covariance.copy()
        changed[2, 2] = deviation**2
        return changed
    factor = np.array([1.0, 1.0, deviation / before])
    return covariance * np.outer(factor, factor)
