"""The loop of the twin: one observed state in, a setpoint and a forecast out.

The five steps of the paper (section 2.4): the asset emits a state; the physics-based model predicts
the next one; the data-driven model corrects the prediction; the physics-based model predicts again
with the correction; the twin emits the result. In the optimising mode (section 4) the twin chooses
the rates first.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from porotwin_core.correction import CorrectionFn
from porotwin_core.grid import FloatArray, fill_unseen, relative_error
from porotwin_core.rates_in_force import (
    PUMP_ACCURACY,
    KnownRates,
    RatePeriod,
    describe_difference,
    different_wells,
    injected_tracer,
    latest_known,
    rates_in_force,
    same_rates,
)
from porotwin_core.state_filter import PUMP_DEVIATION, Estimate, Seen, StateFilter
from porotwin_core.wells import WellRates
from porotwin_hub.controller import Planner
from porotwin_hub.forecast import (
    Forecast,
    Forecaster,
    ModelUnavailable,
    PhysicsModel,
)
from porotwin_hub.optimisation import Decision
from porotwin_hub.rate_learning import DeliveringModel, PumpFactor, RateLearner
from porotwin_hub.setpoint_expiry import SetpointDecision, validity
from porotwin_hub.tracer_balance import imbalance

SAME_TIME_S = 0.5
"""A forecast belongs to a photograph if their times differ by at most this [s]."""


LONGEST_GAP_INTERVALS = 10
"""Longest time between two states in photo intervals. After a longer one the sequence begins anew,
and nothing is predicted over it. A few lost photographs are no interruption."""


@dataclass(frozen=True)
class Observation:
    """An observed state: concentration (nz, nx) [-] at `time` [s]; NaN where nothing was seen.

    `deviation` is its standard deviation, and `systematic` the part of it that stays the same from
    photograph to photograph, both (nz, nx) [-]; None: not known.
    """

    time: float
    concentration: FloatArray
    deviation: FloatArray | None = None
    systematic: FloatArray | None = None


@dataclass
class Cycle:
    """The results of one observation.

    Attributes:
        observation: the state that the asset emitted.
        state: the state estimate, (nz, nx) [-]; without a filter the observation with its unseen
            cells filled in.
        seen: the observation with its errors; None: they are not used.
        observed: the observation, with a filter without the error of its scale, (nz, nx) [-].
        periods: the rates in force [m^3/s] since the last observation; empty: there was none, or
            no model.
        pumped: the rates in force when the observation was made.
        prediction_error: relative error [-] of the prediction made for the observation; NaN: none.
        corrected_error: the same for the corrected prediction.
        expected_error: the same that the deviations of map and forecast lead one to expect.
        disallowed_tracer: observed tracer where the objective does not allow it [m^3].
        setpoint: the rates to command; None: none follows from this observation.
        accepted: whether the asset took the setpoint.
        decision: the result of the optimiser, if it ran.
        elapsed: the forecast of the observation that is judged; None: none could be made.
        forecast: the forecast of the next observation; None: none could be made.
        rate_factors: delivered over commanded rate, by well.
        durations: wall-clock times [s] of 'optimise', 'predict' and 'correct'.
        remarks: faults of the cycle, one line each.
        notes: lines for people that are no faults.
        previous_command: the setpoint in force before this cycle.
    """

    observation: Observation
    state: FloatArray
    periods: tuple[RatePeriod, ...]
    pumped: WellRates
    prediction_error: float = math.nan
    corrected_error: float = math.nan
    expected_error: float = math.nan
    disallowed_tracer: float = math.nan
    setpoint: SetpointDecision | None = None
    accepted: bool = True
    decision: Decision | None = None
    elapsed: Forecast | None = None
    forecast: Forecast | None = None
    rate_factors: dict[str, PumpFactor] = field(default_factory=dict)
    seen: Seen | None = None
    durations: dict[str, float] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    previous_command: SetpointDecision | None = None

    def __post_init__(self) -> None:
        self.observed = self.observation.concentration


class Twin:
    """The loop between two photographs; `cycle` advances it by one observation.

    `decide` and `look_ahead` are the halves of `cycle`: a setpoint need not wait for the forecast
    of the next photograph.
    """

    def __init__(
        self,
        physics: PhysicsModel,
        data_driven: CorrectionFn,
        *,
        photo_interval: float,
        controller: Planner | None = None,
        assumed: WellRates | None = None,
        pore_volume: FloatArray | None = None,
        began: float | None = None,
        state_filter: StateFilter | None = None,
        learner: RateLearner | None = None,
    ) -> None:
        """Make the loop.

        Args:
            physics: the physics-based model.
            data_driven: the data-driven model, or `no_correction`.
            photo_interval: time between photographs [s]; how far a forecast looks ahead.
            controller: chooses setpoints; None: the twin predicts and does not control.
            assumed: rates until any are known, without a controller; None: all wells are off.
            pore_volume: volume of the pores of each cell [m^3], (nz, nx), for the balance of
                tracer; None: no balance is made.
            began: time of the start of the experiment [s]; None: the first observation.
            state_filter: estimates the state from photograph and prediction; None: the state is the
                photograph, its unseen cells filled in (the paper's way).
            learner: learns the rate factors of the pumps, and needs a filter; None: they are 1.
        """
        self._pore_volume = pore_volume
        self._filter = state_filter
        self._estimate: Estimate | None = None
        self._plain_physics = physics
        self._learner = learner
        self._physics = DeliveringModel(physics, learner) if learner is not None else physics
        self._forecaster = Forecaster(self._physics, data_driven)
        self._photo_interval = photo_interval
        self._longest_gap = LONGEST_GAP_INTERVALS * photo_interval
        self._controller = controller
        self._known_start = began
        self._began = began
        self._assumed = assumed or {}
        self.validity = validity(photo_interval)
        """How long a setpoint is valid after its photograph [s]."""
        self._command: SetpointDecision | None = None
        self._pumped: WellRates | None = None
        self._state: Observation | None = None
        self._forecast: Forecast | None = None
        self._expected: FloatArray | None = None

    def interrupt(self) -> None:
        """Forget state and forecast: the next state does not follow from the last."""
        self._state = None
        self._forecast = None
        self._expected = None
        self._estimate = None
        if self._learner is not None:
            self._learner.interrupt()

    def begin_anew(self) -> None:
        """Forget everything, also the setpoint in force: time went back."""
        self.interrupt()
        self._began = self._known_start
        self._command = None
        self._pumped = None
        if self._learner is not None:
            self._learner.begin_anew()

    def forget_rate_factors(self) -> None:
        """Learn the rate factors anew: those learnt with another model may stand for its error."""
        if self._learner is not None:
            self._learner.begin_anew()

    @property
    def controls(self) -> bool:
        """Whether setpoints are chosen."""
        return self._controller is not None

    def change_controller(self, controller: Planner | None) -> None:
        """Choose setpoints by `controller` from now on; None: predict and do not control."""
        self._controller = controller

    def set_aside(self, observation: Observation) -> Cycle:
        """Return the cycle of an observation that is shown and changes nothing."""
        cycle = Cycle(observation, observation.concentration, (), {})
        self._count_disallowed_tracer(cycle)
        return cycle

    def cycle(self, observation: Observation, known: Sequence[KnownRates] = ()) -> Cycle:
        """Return the results of an observation: `decide`, then `look_ahead`."""
        cycle = self.decide(observation, known)
        self.look_ahead(cycle)
        return cycle

    def decide(
        self,
        observation: Observation,
        known: Sequence[KnownRates] = (),
        *,
        actuate: bool = True,
    ) -> Cycle:
        """Return the state estimate and the setpoint that follow from an observation.

        If the rates in force since the last observation differ from the rates of the forecast, the
        elapsed interval is forecast again first. A model that does not answer is a remark of the
        cycle; the setpoint is then the last one while it is valid, afterwards the safe rates.

        Args:
            observation: the state that the asset emitted.
            known: rates measured or confirmed since the last observation. Where none are known, the
                commanded rates count as pumped.
            actuate: False for a state too old to act on: no setpoint follows from it.
        """
        cycle = self._begin(observation, known)
        self._count_disallowed_tracer(cycle)
        if self._controller is not None and actuate:
            self._choose_setpoint(cycle, self._controller)
        return cycle

    def reject_setpoint(self, cycle: Cycle) -> None:
        """Go on without the setpoint of `cycle`, because the asset did not take it."""
        cycle.accepted = False
        self._command = cycle.previous_command

    def look_ahead(self, cycle: Cycle) -> None:
        """Judge the forecast of the observation, and forecast the next observation.

        A model that does not answer is a remark of the cycle.
        """
        self._judge(cycle)
        self._learn_rates(cycle)
        self._forecast_next(cycle)
        self._state = Observation(cycle.observation.time, cycle.state)
        self._forecast = cycle.forecast
        self._pumped = cycle.pumped
        self._expected = cycle.forecast.corrected if cycle.forecast is not None else cycle.state

    def _count_disallowed_tracer(self, cycle: Cycle) -> None:
        if self._controller is not None:
            objective = self._controller.objective
            cycle.disallowed_tracer = objective.disallowed_tracer(cycle.observation.concentration)

    def _begin(self, observation: Observation, known: Sequence[KnownRates]) -> Cycle:
        """Return a cycle with the rates in force, the elapsed forecast and the state estimate."""
        now = observation.time
        self._began = now if self._began is None else self._began
        gap = now - self._state.time if self._state is not None else 0.0
        if gap > self._longest_gap:
            self.interrupt()
        commanded = self._commanded_rates(now)
        known = self._as_told(known, commanded)
        if self._state is None:
            periods: tuple[RatePeriod, ...] = ()
            pumped = latest_known(known, now) or commanded
        else:
            before = self._pumped if self._pumped is not None else commanded
            periods = rates_in_force(
                known, self._state.time, now, commanded=commanded, before=before
            )
            pumped = periods[-1].rates
        cycle = Cycle(observation, observation.concentration, periods, pumped)
        if gap > self._longest_gap:
            cycle.notes.append(f'interrupted: {gap:.0f} s without a photograph; none is predicted')
        if self._state is not None:
            self._forecast_elapsed(cycle, self._state)
        self._estimate_state(cycle)
        return cycle

    def _estimate_state(self, cycle: Cycle) -> None:
        """Set the state of `cycle` from its observation and the prediction for it."""
        observation, elapsed = cycle.observation, cycle.elapsed
        expected = elapsed.corrected if elapsed is not None else self._expected
        if self._filter is None:
            cycle.state = fill_unseen(observation.concentration, expected)
            return
        seen = Seen.of(observation.concentration, observation.deviation, observation.systematic)
        if elapsed is None or self._estimate is None:
            self._estimate = self._filter.begin(seen, expected)
        else:
            injected = injected_tracer(cycle.periods)
            self._estimate = self._filter.update(
                self._estimate, elapsed.corrected, seen, injected, self._pump_deviation(cycle)
            )
        cycle.seen = seen
        cycle.state = self._estimate.concentration
        cycle.observed = self._estimate.observed
        cycle.expected_error = self._estimate.expected_error

    def _factors(self) -> dict[str, PumpFactor]:
        """Return the learnt share of its rate that each pump delivers, by well."""
        return self._learner.factors if self._learner is not None else {}

    def _pump_deviation(self, cycle: Cycle) -> float:
        """Return the standard deviation of the rate factor of the tracer's pump [-]."""
        if self._learner is None:
            return PUMP_DEVIATION
        factors = self._learner.factors
        deviations = [
            factors[name].deviation
            for name, well in cycle.pumped.items()
            if well.rate > 0.0 and well.concentration > 0.0
        ]
        return max(deviations, default=0.0)

    def _forecast_elapsed(self, cycle: Cycle, last: Observation) -> None:
        """Set the forecast that was made for the observation, if there was one.

        It is made again if other rates were pumped than it assumed, or if the photograph came at
        another time.
        """
        planned = self._forecast
        if planned is None:
            return
        as_planned = all(same_rates(period.rates, planned.rates) for period in cycle.periods)
        if as_planned and abs(planned.time - cycle.observation.time) <= SAME_TIME_S:
            cycle.elapsed = planned
            return
        try:
            cycle.elapsed = self._forecaster.forecast(last.concentration, cycle.periods)
        except ModelUnavailable as error:
            cycle.remarks.append(f'no prediction for this photograph: {error}')
            cycle.periods = ()
            return
        difference = '' if as_planned else describe_difference(cycle.periods, planned.rates)
        if difference:
            cycle.notes.append(f'predicted again with the rates in force: {difference}')

    def _commanded_rates(self, now: float) -> WellRates:
        """Return the rates that the wells should pump at `now` [s]."""
        if self._controller is None:
            return self._pumped if self._pumped is not None else self._assumed
        if self._command is None or self._command.expired(now):
            return self._controller.limits.safe()
        return self._command.rates

    def _learn_rates(self, cycle: Cycle) -> None:
        """Learn the rate factors; a model that does not answer is a remark of the cycle."""
        if self._learner is None or self._estimate is None or cycle.seen is None:
            return
        time = cycle.observation.time
        try:
            self._learner.learn(
                self._plain_physics, time, self._estimate, cycle.seen, cycle.periods
            )
        except ModelUnavailable as error:
            cycle.remarks.append(f'no rates learnt: {error}')
        cycle.rate_factors = self._learner.factors

    def _as_told(self, known: Sequence[KnownRates], commanded: WellRates) -> list[KnownRates]:
        """Return `known` rates as the pumps were told; measured ones teach the rate factors."""
        if self._learner is None:
            return list(known)
        told = [
            item if item.is_open else item._replace(rates=self._learner.told(item.rates))
            for item in known
        ]
        for item in known:
            if not item.is_open:
                self._learner.meter(item.rates, commanded)
        return told

    def _judge(self, cycle: Cycle) -> None:
        """Compare the observation with its forecast, or with one made now for its time."""
        if self._state is None or not cycle.periods:
            return
        if cycle.elapsed is None:
            try:
                cycle.elapsed = self._forecaster.forecast(self._state.concentration, cycle.periods)
            except ModelUnavailable as error:
                cycle.remarks.append(f'no prediction for this photograph: {error}')
                return
        cycle.prediction_error = relative_error(cycle.elapsed.predicted, cycle.observed)
        cycle.corrected_error = relative_error(cycle.elapsed.corrected, cycle.observed)
        if self._pore_volume is not None:
            observed = cycle.observation.concentration
            remark = imbalance(observed, cycle.elapsed.predicted, self._pore_volume)
            cycle.remarks += [remark] if remark else []

    def _choose_setpoint(self, cycle: Cycle, controller: Planner) -> None:
        now = cycle.observation.time
        begin = time.perf_counter()
        try:
            cycle.decision = controller.decide(
                self._physics,
                cycle.state,
                self._rates_to_change(cycle, controller),
                now=now - (self._began or 0.0),
                delivery=self._delivery(),
            )
            cycle.remarks += [cycle.decision.remark] if cycle.decision.remark else []
        except ModelUnavailable as error:
            cycle.setpoint = self._setpoint_without_model(now, str(error), controller)
            cycle.remarks.append(f'not optimised: {error}')
        else:
            rates, reason = cycle.decision.rates, controller.objective.goal
            broken = controller.limits.violations(rates, self._commanded_rates(now))
            if broken:  # impossible while `Limits.setpoint` is right; a cheap check of the pumps
                cycle.remarks.append(f'optimised rates refused: {"; ".join(broken)}')
                rates, reason = controller.limits.safe(), 'optimised rates broke a limit'
            cycle.setpoint = SetpointDecision(rates, now + self.validity, reason)
        cycle.durations['optimise'] = time.perf_counter() - begin
        cycle.previous_command, self._command = self._command, cycle.setpoint

    def _rates_to_change(self, cycle: Cycle, controller: Planner) -> WellRates:
        """Return the rates that a decision starts from: those in force.

        They are the commanded ones where the pumps are within their accuracy of them. A limit on
        changes counts from setpoint to setpoint.
        """
        commanded = self._commanded_rates(cycle.observation.time)
        if math.isfinite(controller.limits.max_change):
            return commanded
        other = different_wells(cycle.pumped, commanded, accuracy=PUMP_ACCURACY)
        return cycle.pumped if other else commanded

    def _delivery(self) -> dict[str, float]:
        """Return the share of its commanded rate that each pump delivers, where it is known."""
        if self._learner is None:
            return {}
        return {well: found.factor for well, found in self._learner.factors.items()}

    def _setpoint_without_model(
        self, now: float, reason: str, controller: Planner
    ) -> SetpointDecision:
        """Return the setpoint in force while it is valid, afterwards the safe rates."""
        held = self._command
        if held is not None and not held.expired(now):
            return SetpointDecision(held.rates, held.valid_until, f'held: {reason}')
        safe = controller.limits.safe()
        return SetpointDecision(safe, now + self.validity, f'safe rates: {reason}')

    def _forecast_next(self, cycle: Cycle) -> None:
        now = cycle.observation.time
        planned = cycle.setpoint.rates if cycle.setpoint and cycle.accepted else cycle.pumped
        period = RatePeriod(now, now + self._photo_interval, planned)
        try:
            cycle.forecast = self._forecaster.forecast(cycle.state, [period], cycle.durations)
        except ModelUnavailable as error:
            cycle.remarks.append(f'no forecast: {error}')
