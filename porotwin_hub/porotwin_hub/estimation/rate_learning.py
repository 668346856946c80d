"""Learns the rate factor of each pump on line: delivered over commanded rate.

The photograph is compared with predictions from a state some minutes ago: one with the rates in
force, and one for each pumping well with a changed rate. The differences are the derivatives of the
map by the rates. A linear least-squares update with a prior follows (Tarantola, Inverse Problem
Theory, 2005, sec. 3.2). The scale of the photographs is an unknown beside the rates, because a pump
that injects more tracer and a camera that shows more look alike.
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.map_blocks import Blocks, error_variance
from porotwin_core.model.correction import Correction, CorrectionFn
from porotwin_core.model.state_filter import Estimate, Seen
from porotwin_core.model.tracer_volume import Volume
from porotwin_core.rates.delivered_rates import (
    MEMORY_S,
    RATE_DEVIATION,
    USUAL_PUMP,
    WINDOW_S,
    PumpFactor,
    delivered,
)
from porotwin_core.rates.rate_periods import SAME_RATE, RatePeriod, injected_tracer, joined
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_hub.estimation.pump_watch import (
    MOST_SHARE,
    WATCH_S,
    WATCH_WINDOW_S,
    Expectations,
    PumpWatch,
)
from porotwin_hub.models.forecast import PhysicsModel
from porotwin_hub.models.plant_knowledge import STANDS

PERIOD_S = 300.0
"""Time between two updates [s], and shortest course that a photograph is compared with; each update
takes a prediction for every well."""

CHANGE = 0.05
"""Change of the log of a factor for a derivative: large beside round-off, small beside 1."""

METER_SHARE = 0.5
"""Weight of a new measurement in the factor by a meter."""

METER_JUMP = 0.3
"""A factor that differs by more is taken as it is: the pump has stopped, or runs again."""

LATE_MEASUREMENTS = 6
"""Measurements after a new command during which a rate that does not change tells nothing: a person
may be late. After that the pump is at fault."""

IDLE_SHARE = 0.05
"""Share of the way back to 1 that the factor of a well at rest goes per measurement: a pump may
have been mended, or a person may have refused an order."""

MOST_METERED = 2.0
"""Greatest measured over commanded rate that is believed [-]."""

LEAST_COMMANDED = 20 * SAME_RATE
"""Least commanded rate that is compared with a measured one [m^3/s]."""


class _Unset(NamedTuple):
    """A command that may not be set yet: the rate `measured` before it [m^3/s], and the number of
    measurements that are still waited for."""

    measured: float
    left: int


class _Moment(NamedTuple):
    """A state at `time` [s], the systematic deviation of its photograph (nz, nx) [-], and the rates
    until the next one, as far as meters tell what was delivered."""

    time: float
    estimate: Estimate
    systematic: FloatArray
    periods: tuple[RatePeriod, ...]


@dataclass(frozen=True)
class _Course:
    """Predicts the means of blocks of a photograph, from a state before the `periods`.

    `known` are the cells (nz, nx) that it shows; `closed` tells whether all sides of the rig are.
    """

    physics: PhysicsModel
    periods: Sequence[RatePeriod]
    blocks: Blocks
    known: NDArray[np.bool_]
    closed: bool

    def means(self, values: FloatArray) -> FloatArray:
        """Return the means of a map (nz, nx) over the blocks, (blocks,)."""
        return self.blocks.means(values, self.known)

    def expected(self, state: FloatArray, factors: Mapping[str, float]) -> FloatArray:
        """Return the means (blocks,) after `state` (nz, nx), with these `factors` on the rates."""
        for start, end, rates in self.periods:
            pumped = delivered(rates, factors, closed=self.closed)
            state = self.physics.predict(state, pumped, end - start)
        return self.means(state)


class RateLearner:
    """Follows the rate factors of all wells of a rig: the only one who estimates them."""

    def __init__(self, deviations: Mapping[str, float], grid: Grid, *, closed: bool) -> None:
        """Know nothing yet.

        Args:
            deviations: of the log of the rate factor before any photograph, by well.
            grid: of the maps.
            closed: whether all sides of the rig are closed.
        """
        self._wells, self._closed = tuple(deviations), closed
        self._prior = np.diag(np.square(list(deviations.values())))
        self._blocks = Blocks.of(grid)
        self._past: deque[_Moment] = deque()
        self._watch = PumpWatch()
        self.begin_anew()

    def interrupt(self) -> None:
        """Forget the states: the next one does not follow from them."""
        self._past.clear()

    def begin_anew(self) -> None:
        """Forget everything."""
        self.interrupt()
        self._learnt = self._watched = -math.inf
        self._watch.begin_anew()
        self._commanded: dict[str, float] = {}
        self._measured: dict[str, float] = {}
        self._unset: dict[str, _Unset] = {}
        self._metered = dict.fromkeys(self._wells, 1.0)
        self._mean = np.zeros(len(self._wells))
        self._covariance = self._prior

    @property
    def factors(self) -> dict[str, PumpFactor]:
        """The rate factor of every pump, by its meter and by the photographs.

        A pump that photographs found to deliver far less or more has the factor of that.
        """
        deviations = np.sqrt(np.diag(self._covariance))
        return {
            well: PumpFactor(factor, factor * float(deviation), self._metered[well])
            for (well, factor), deviation in zip(
                self._with(self._mean).items(), deviations, strict=True
            )
        }

    def _with(self, log_factors: FloatArray) -> dict[str, float]:
        """Return the factors by meter, times the exponentials of `log_factors`, by well."""
        return {
            well: self._metered[well] * self._watch.share(well) * math.exp(log_factor)
            for well, log_factor in zip(self._wells, log_factors, strict=True)
        }

    def delivered(self, rates: WellRates) -> WellRates:
        """Return the rates [m^3/s] that the pumps deliver when they are told `rates`."""
        return delivered(rates, self._with(self._mean), closed=self._closed)

    def metered(self, periods: Sequence[RatePeriod]) -> tuple[RatePeriod, ...]:
        """Return `periods` with the rates that meters tell to be delivered."""
        return tuple(
            period._replace(rates=delivered(period.rates, self._metered, closed=self._closed))
            for period in periods
        )

    def tracer_factor(self, periods: Sequence[RatePeriod]) -> PumpFactor:
        """Return the factor of all pumps of tracer together, for the rates that they were told."""
        told = injected_tracer(periods)
        pumped = [period._replace(rates=self.delivered(period.rates)) for period in periods]
        wells = {
            name
            for period in periods
            for name in period.rates
            if period.rates[name].concentration > 0.0
        }
        deviations = [found.deviation for well, found in self.factors.items() if well in wells]
        factor = injected_tracer(pumped) / told if told > 0.0 else 1.0
        return USUAL_PUMP._replace(factor=factor, deviation=max(deviations, default=RATE_DEVIATION))

    def told(self, measured: WellRates) -> WellRates:
        """Return the rates [m^3/s] that pumps are told when their meters show `measured` ones."""
        return {
            name: WellRate(well.rate / self._metered.get(name, 1.0), well.concentration)
            for name, well in measured.items()
        }

    def meter(self, measured: WellRates, commanded: WellRates) -> None:
        """Compare `measured` rates with the ones `commanded` meanwhile [m^3/s].

        A well whose command has changed tells nothing until its rate changes, or some measurements
        have come: a person may set its pump late.
        """
        for well in self._wells:
            wanted = commanded.get(well, WellRate()).rate
            before, self._commanded[well] = self._commanded.get(well), wanted
            if well not in measured:
                continue
            rate = measured[well].rate
            self._watch.forget(well)
            last, self._measured[well] = self._measured.get(well, rate), rate
            if wanted != before:
                near = abs(rate - wanted) <= METER_JUMP * abs(wanted)
                waits = 0 if before is None and near else LATE_MEASUREMENTS
                self._unset[well] = _Unset(last, waits)
            elif abs(wanted) < LEAST_COMMANDED:
                self._metered[well] += IDLE_SHARE * (1.0 - self._metered[well])
            elif not self._is_late(well, rate):
                self._compare(well, rate / wanted)

    def _is_late(self, well: str, rate: float) -> bool:
        """Return whether the command of a `well` that pumps `rate` [m^3/s] may not be set yet."""
        waiting = self._unset.get(well)
        if waiting is None:
            return False
        if waiting.left == 0 or abs(rate - waiting.measured) > SAME_RATE:
            del self._unset[well]
            return False
        self._unset[well] = waiting._replace(left=waiting.left - 1)
        return True

    def _compare(self, well: str, measured_share: float) -> None:
        """Take a measured over commanded rate into the factor of a `well`."""
        share = min(max(measured_share, STANDS), MOST_METERED)
        change = share - self._metered[well]
        self._metered[well] += change if abs(change) > METER_JUMP else METER_SHARE * change

    def learn(
        self,
        physics: PhysicsModel,
        time: float,
        estimate: Estimate,
        seen: Seen,
        periods: tuple[RatePeriod, ...],
    ) -> list[str]:
        """Take a new state, and learn from it if enough time has passed.

        Args:
            physics: the model, which takes delivered rates.
            time: of the photograph [s].
            estimate: the state at that time.
            seen: the photograph.
            periods: rates that the pumps were told since the last state; empty: none is known.

        Returns:
            A line for people about each pump that begins or ceases to be at fault.

        Raises:
            ModelUnavailable: the model does not answer; nothing was learnt.
        """
        told: list[str] = []
        if not periods:
            self.interrupt()
        if self._past:
            self._past[-1] = self._past[-1]._replace(periods=self.metered(periods))
            changed = self._changed(time, estimate.volume, periods)
            if changed or time - max(self._watched, self._past[0].time) >= WATCH_S:
                told = self._watch_pumps(physics, time, estimate, seen, changed)
        if self._past and time - max(self._learnt, self._past[0].time) >= PERIOD_S:
            self._update(physics, time, estimate, seen)
            self._learnt = time
        self._past.append(_Moment(time, estimate, seen.systematic, ()))
        while time - self._past[0].time > WINDOW_S:
            self._past.popleft()
        return told

    def _course(self, physics: PhysicsModel, begin: float, estimate: Estimate) -> _Course:
        """Return the course from the state at `begin` [s] to the photograph of `estimate`."""
        periods = [
            period for moment in self._past if moment.time >= begin for period in moment.periods
        ]
        known = np.isfinite(estimate.observed)
        return _Course(physics, joined(periods), self._blocks, known, self._closed)

    def _changed(self, time: float, volume: Volume, periods: Sequence[RatePeriod]) -> int:
        """Return how many photographs ago a pump of tracer seems to have changed its delivery.

        0: none has, or it is so long ago that the regular tests have seen it.
        """
        since = volume.since or 0
        if not 0 < since <= len(self._past) or time - self._past[-since].time > WATCH_S:
            return 0
        change = volume.share - self.tracer_factor(periods).factor
        return since if abs(change) >= 1.0 - MOST_SHARE else 0

    def _watch_pumps(
        self, physics: PhysicsModel, time: float, estimate: Estimate, seen: Seen, changed: int
    ) -> list[str]:
        """Return the new beliefs about pumps without a meter that deliver far less or more.

        The delivery of tracer may have `changed` so many photographs ago; 0: it has not.
        """
        elapsed = min(time - self._watched, time - self._past[0].time)
        self._watched = time
        within = (moment for moment in self._past if time - moment.time <= WATCH_WINDOW_S)
        # photographs may be further apart
        begin = self._past[-changed] if changed else next(within, self._past[-1])
        course = self._course(physics, begin.time, estimate)
        last = course.periods[-1].rates
        pumping = [
            well
            for well in _pumping(self._wells, course.periods)
            if well not in self._measured and not (self._closed and last[well].rate < 0.0)
        ]
        self._watch.rest([well for well in self._wells if well not in pumping], elapsed)
        if not pumping:
            return []
        return self._watch.test(lambda: self._expectations(course, begin, estimate, seen, pumping))

    def _expectations(
        self,
        course: _Course,
        begin: _Moment,
        estimate: Estimate,
        seen: Seen,
        pumping: Sequence[str],
    ) -> Expectations:
        """Return what the photograph would show if a well of `pumping` delivered otherwise."""
        state = begin.estimate.concentration
        factors = {
            well: self._watch.share(well) * math.exp(log_factor)
            for well, log_factor in zip(self._wells, self._mean, strict=True)
        }
        usual = course.expected(state, factors)
        changed = {
            (well, share): course.expected(state, {**factors, well: share})
            for well in pumping
            for share in self._watch.shares(well)
        }
        deviations = dict(zip(self._wells, np.sqrt(np.diag(self._covariance)), strict=True))
        rates = [deviations[well] * (means - usual) for (well, _), means in changed.items()]
        scale = math.sqrt(float(estimate.volume.covariance[1, 1]))
        camera = scale * course.means(seen.systematic)
        variance = error_variance(course.means(seen.random**2))
        observed = course.means(estimate.observed)
        return Expectations(observed, usual, changed, variance, np.array([*rates, camera]))

    def _update(self, physics: PhysicsModel, time: float, estimate: Estimate, seen: Seen) -> None:
        begin = self._past[0]
        course = self._course(physics, begin.time, estimate)
        blocks = course.means

        def expected(state: FloatArray, log_factors: FloatArray) -> FloatArray:
            shares = zip(self._wells, log_factors, strict=True)
            factors = {well: self._watch.share(well) * math.exp(log) for well, log in shares}
            return course.expected(state, factors)

        start = begin.estimate.concentration
        usual = expected(start, self._mean)
        pumping = _pumping(self._wells, course.periods)
        active = [self._wells.index(well) for well in pumping]
        slopes = []
        for place in active:
            changed = self._mean.copy()
            changed[place] += CHANGE
            slopes.append((expected(start, changed) - usual) / CHANGE)
        dimmed = expected(np.clip(start - begin.systematic, 0.0, 1.0), self._mean)
        slopes.append(blocks(seen.systematic) - (usual - dimmed))
        length = time - begin.time
        elapsed = min(time - self._learnt, length)
        variance = error_variance(blocks(seen.random**2), alike=length / elapsed)
        self._fade(elapsed)
        scale = float(estimate.volume.covariance[1, 1])
        self._solve(active, np.array(slopes), blocks(estimate.observed) - usual, variance, scale)

    def _fade(self, elapsed: float) -> None:
        """Let the belief fade to the prior over `elapsed` [s]."""
        keep = math.exp(-elapsed / MEMORY_S)
        self._mean = keep * self._mean
        self._covariance = self._prior + keep**2 * (self._covariance - self._prior)

    def _solve(
        self,
        active: list[int],
        slopes: FloatArray,
        difference: FloatArray,
        variance: FloatArray,
        scale_variance: float,
    ) -> None:
        """Update mean and covariance.

        Args:
            active: places of the wells that pumped.
            slopes: derivatives of the blocks by their log factors, and by the scale of the
                photographs, (active + 1, blocks).
            difference: observed minus expected blocks, (blocks,).
            variance: of the errors of `difference`, (blocks,).
            scale_variance: of the scale of the photographs.
        """
        count = len(self._wells)
        prior = np.zeros((count + 1, count + 1))
        prior[:count, :count] = self._covariance
        prior[count, count] = scale_variance
        jacobian = np.zeros((len(difference), count + 1))
        jacobian[:, [*active, count]] = slopes.T
        weighted = jacobian / variance[:, None]
        gain = np.linalg.solve(np.eye(count + 1) + prior @ (jacobian.T @ weighted), prior)
        self._mean = self._mean + (gain @ (weighted.T @ difference))[:count]
        self._covariance = 0.5 * (gain + gain.T)[:count, :count]


def _pumping(wells: Sequence[str], periods: Sequence[RatePeriod]) -> list[str]:
    """Return the `wells` that pump in one of the `periods`, in their order."""
    return [
        well
        for well in wells
        if any(abs(rates[well].rate) > SAME_RATE for _, _, rates in periods if well in rates)
    ]


class DeliveringModel:
    """The physics-based model for commanded rates: it predicts with the delivered ones."""

    def __init__(self, physics: PhysicsModel, learner: RateLearner) -> None:
        """Ask `physics` with the rates that `learner` believes to be delivered."""
        self._physics = physics
        self._learner = learner

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the prediction (nz, nx) [-] after `time_step` [s].

        Raises:
            ModelUnavailable: the model does not answer.
        """
        return self._physics.predict(concentration, self._learner.delivered(rates), time_step)

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return the corrected prediction (nz, nx) [-] with the source `sigma` [1/s].

        Raises:
            ModelUnavailable: the model does not answer.
        """
        pumped = self._learner.delivered(rates)
        return self._physics.correct(previous, sigma, pumped, time_step)


def correcting_delivered(correct: CorrectionFn, learner: RateLearner) -> CorrectionFn:
    """Return the data-driven model for commanded rates: `correct` is asked with the delivered ones.

    COSTA learns from measured rates, and it corrects a prediction that was made with delivered
    ones. With others its learnt physics would take the factor of a pump out again.
    """

    def corrected(
        predicted: FloatArray, rates: WellRates, time_step: float, previous: FloatArray
    ) -> Correction:
        return correct(predicted, learner.delivered(rates), time_step, previous)

    return corrected
