"""The twin's loop on a page: one observed state in, a setpoint and a forecast out.

The five steps of the paper (section 2.4): the asset emits a state; ask the physics-based model for
a prediction; ask the data-driven model for a correction; ask the physics-based model for the
corrected prediction; emit it. In the optimising mode (section 4) the rates are chosen first. The
models are callables: local objects in tests, service clients in the running graph.
"""

import math
import time
from dataclasses import dataclass, field
from typing import Protocol

from porotwin_core.correction import Correction, CorrectionFn
from porotwin_core.grid import FloatArray, Grid, fill_unseen, relative_error
from porotwin_core.wells import WellRate, WellRates
from porotwin_hub.control import Decision, Limits, optimise
from porotwin_hub.objective import Objective

TIME_TOLERANCE = 0.5
"""A forecast is for a photograph when their times differ by no more than this [s]."""


class ModelUnavailable(Exception):  # noqa: N818  it is a state of the graph, not a mistake
    """A model did not answer; the message says which and what would mend it."""


class PhysicsModel(Protocol):
    """The physics-based model as the loop needs it; arrays (nz, nx), time_step [s]."""

    def predict(
        self, concentration: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray: ...

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray: ...


def no_correction(*_: object) -> Correction:
    """Return no correction: the loop without a data-driven model."""
    return Correction(None, 'no data-driven model')


@dataclass(frozen=True)
class Observation:
    """An observed state: concentration (nz, nx) with NaN where nothing was seen, at `time` [s]."""

    time: float
    concentration: FloatArray


@dataclass(frozen=True)
class Forecast:
    """What the twin expects at `time`, from the state at `start`, if `rates` are pumped."""

    start: float
    time: float
    rates: WellRates
    predicted: FloatArray
    corrected: FloatArray
    correction_status: str
    is_corrected: bool


@dataclass(frozen=True)
class SetpointDecision:
    """Rates for the wells, until when they are good, and why."""

    rates: dict[str, WellRate]
    valid_until: float
    reason: str


@dataclass
class Cycle:
    """All that one observation led to.

    `state` is the observation with unseen cells filled in, `pumped` what was pumped before it.
    """

    observation: Observation
    state: FloatArray
    pumped: WellRates
    prediction_error: float = math.nan
    corrected_error: float = math.nan
    disallowed_tracer: float = math.nan
    setpoint: SetpointDecision | None = None
    told_before: SetpointDecision | None = None
    taken: bool = True
    decision: Decision | None = None
    forecast: Forecast | None = None
    durations: dict[str, float] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


class Twin:
    """State of the loop between two photographs; `cycle` advances it by one.

    `decide` and `look_ahead` are its halves, so that a setpoint need not wait for forecasts.
    """

    def __init__(
        self,
        physics: PhysicsModel,
        data_driven: CorrectionFn,
        grid: Grid,
        *,
        photo_interval: float,
        horizon: float,
        evaluations: int,
        limits: Limits | None = None,
        objective: Objective | None = None,
        validity_intervals: int = 3,
        patience: float = math.inf,
        assumed: WellRates | None = None,
    ) -> None:
        """Make the loop.

        Args:
            physics: the physics-based model.
            data_driven: the data-driven model, or `no_correction`.
            grid: the grid of all maps.
            photo_interval: time between photographs [s]; how far a forecast looks ahead.
            horizon: how far the optimiser looks ahead [s].
            evaluations: predictions that the optimiser may ask for in one cycle.
            limits: of the wells; None: the twin predicts and does not control.
            objective: what the optimiser minimises; needed with `limits`.
            validity_intervals: for how many photo intervals a setpoint is good.
            patience: how long one optimisation may take by the wall clock [s].
            assumed: what the wells pump while nobody says, without `limits`; None: nothing.
        """
        self._physics = physics
        self._data_driven = data_driven
        self._grid = grid
        self._photo_interval = photo_interval
        self._horizon = horizon
        self._evaluations = evaluations
        self._limits = limits
        self._objective = objective
        self._patience = patience
        self._assumed = assumed or {}
        self.validity = validity_intervals * photo_interval
        """How long a setpoint is good after its photograph [s]."""
        self._told: SetpointDecision | None = None
        self._nominal: FloatArray | None = None
        self._state: Observation | None = None
        self._forecast: Forecast | None = None

    def interrupt(self) -> None:
        """Forget the sequence of time: the next state does not follow from the last."""
        self._state = None
        self._forecast = None
        self._nominal = None

    def begin_anew(self) -> None:
        """Forget everything: time went back, so what was told belongs to another course of it."""
        self.interrupt()
        self._told = None

    def cycle(self, observation: Observation, measured: WellRates | None) -> Cycle:
        """Return what follows from an observation: `decide`, then `look_ahead`."""
        cycle = self.decide(observation, measured)
        self.look_ahead(cycle)
        return cycle

    def decide(
        self, observation: Observation, measured: WellRates | None, *, steer: bool = True
    ) -> Cycle:
        """Return the setpoint that follows from an observation.

        Args:
            observation: the state that the asset emitted.
            measured: what the wells pumped since the previous state; None: not known, so the last
                setpoint is taken to have been followed.
            steer: False for a state that is too old to act on: no setpoint follows from it.

        A model that does not answer is a remark of the cycle, never an exception: the setpoint is
        then the last one while it is valid, afterwards the safe rates.
        """
        cycle = Cycle(
            observation,
            state=fill_unseen(observation.concentration, self._nominal),
            pumped=measured if measured is not None else self._told_rates(observation.time),
        )
        if self._objective is not None:
            cycle.disallowed_tracer = self._objective.disallowed_tracer(observation.concentration)
        if steer:
            self._decide(cycle)
        return cycle

    def not_taken(self, cycle: Cycle) -> None:
        """Go on as if the setpoint of `cycle` had not been told: the rig did not take it."""
        cycle.taken = False
        self._told = cycle.told_before

    def look_ahead(self, cycle: Cycle) -> None:
        """Judge the forecast made for the observation, and forecast the next photograph.

        A model that does not answer is a remark of the cycle.
        """
        self._judge(cycle)
        self._forecast_next(cycle)
        self._state = Observation(cycle.observation.time, cycle.state)
        self._forecast = cycle.forecast
        self._nominal = cycle.forecast.corrected if cycle.forecast is not None else cycle.state

    def _told_rates(self, now: float) -> WellRates:
        if self._told is None:
            return self._limits.safe() if self._limits is not None else self._assumed
        if now > self._told.valid_until and self._limits is not None:
            return self._limits.safe()
        return self._told.rates

    def _judge(self, cycle: Cycle) -> None:
        """Compare the observation with the forecast made for its time, or with one made now."""
        if self._state is None:
            return
        forecast, now = self._forecast, cycle.observation.time
        if forecast is None or abs(forecast.time - now) > TIME_TOLERANCE:
            try:
                forecast = self._make_forecast(
                    self._state.concentration, cycle.pumped, self._state.time, now, durations={}
                )
            except ModelUnavailable as error:
                cycle.remarks.append(f'no prediction for this photograph: {error}')
                return
        observed = cycle.observation.concentration
        cycle.prediction_error = relative_error(forecast.predicted, observed)
        cycle.corrected_error = relative_error(forecast.corrected, observed)

    def _decide(self, cycle: Cycle) -> None:
        if self._limits is None or self._objective is None:
            return
        now = cycle.observation.time
        started = time.perf_counter()
        try:
            cycle.decision = self._optimise(cycle.state, now)
        except ModelUnavailable as error:
            cycle.setpoint = self._without_model(now, str(error))
            cycle.remarks.append(f'not optimised: {error}')
        else:
            rates, reason = cycle.decision.rates, 'least tracer in the disallowed zone'
            broken = self._limits.violations(rates)
            if (
                broken
            ):  # cannot happen while `Limits.setpoint` is right; the pumps are worth a check
                cycle.remarks.append(f'optimised rates refused: {"; ".join(broken)}')
                rates, reason = self._limits.safe(), 'optimised rates broke a limit'
            cycle.setpoint = SetpointDecision(rates, now + self.validity, reason)
        cycle.durations['optimise'] = time.perf_counter() - started
        cycle.told_before, self._told = self._told, cycle.setpoint

    def _optimise(self, state: FloatArray, now: float) -> Decision:
        assert self._limits is not None
        objective = self._objective
        assert objective is not None

        def cost(rates: WellRates) -> float:
            return objective(self._physics.predict(state, rates, self._horizon))

        return optimise(
            self._limits,
            cost,
            self._told_rates(now),
            evaluations=self._evaluations,
            patience=self._patience,
        )

    def _without_model(self, now: float, why: str) -> SetpointDecision:
        assert self._limits is not None
        if self._told is not None and now <= self._told.valid_until:
            return SetpointDecision(self._told.rates, self._told.valid_until, f'held: {why}')
        return SetpointDecision(self._limits.safe(), now + self.validity, f'safe rates: {why}')

    def _forecast_next(self, cycle: Cycle) -> None:
        now = cycle.observation.time
        planned = cycle.setpoint.rates if cycle.setpoint and cycle.taken else cycle.pumped
        try:
            cycle.forecast = self._make_forecast(
                cycle.state, planned, now, now + self._photo_interval, durations=cycle.durations
            )
        except ModelUnavailable as error:
            cycle.remarks.append(f'no forecast: {error}')

    def _make_forecast(
        self,
        state: FloatArray,
        rates: WellRates,
        start: float,
        end: float,
        *,
        durations: dict[str, float],
    ) -> Forecast:
        step = end - start
        clock = time.perf_counter
        begun = clock()
        predicted = self._physics.predict(state, rates, step)
        durations['predict'] = clock() - begun
        begun = clock()
        correction = self._data_driven(predicted, rates, step)
        corrected = correction.applied_to(
            predicted, lambda sigma: self._physics.correct(state, sigma, rates, step)
        )
        durations['correct'] = clock() - begun
        return Forecast(
            start, end, rates, predicted, corrected, correction.status, correction.applied
        )
