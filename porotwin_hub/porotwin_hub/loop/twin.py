"""The loop of the twin: one observed state in, a setpoint and a forecast out.

The five steps of the paper (section 2.4): the asset emits a state; the physics-based model predicts
the next one; the data-driven model corrects the prediction; the physics-based model predicts again
with the correction; the twin emits the result. In the optimising mode (section 4) the twin chooses
the rates first.
"""

import math
from collections import deque
from collections.abc import Sequence

from porotwin_core.clock.freshness import LEARNING_PHOTOGRAPHS
from porotwin_core.clock.photo_interval import LONGEST_GAP_INTERVALS
from porotwin_core.clock.stamps import SAME_PHOTOGRAPH_S
from porotwin_core.geometry.grid import relative_error
from porotwin_core.model.correction import CorrectionFn
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS
from porotwin_core.model.state_filter import StateFilter
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import (
    KnownRates,
    RatePeriod,
    describe_difference,
    different_wells,
    injected_tracer,
    plan_periods,
    to_predict,
)
from porotwin_core.rates.wells import RateStep, WellRates
from porotwin_core.rig import Rig
from porotwin_hub.control.controller import Planner
from porotwin_hub.estimation.rate_learning import (
    DeliveringModel,
    RateLearner,
    correcting_delivered,
)
from porotwin_hub.estimation.tracer_watch import TracerWatch
from porotwin_hub.loop.cycle import Cycle, Observation
from porotwin_hub.loop.photo_pace import odd_pace
from porotwin_hub.loop.setpoint_choice import SetpointChoice
from porotwin_hub.loop.state_estimation import StateEstimation
from porotwin_hub.models.forecast import Forecast, Forecaster, ModelUnavailable, PhysicsModel
from porotwin_hub.models.plant_knowledge import PlantKnowledge


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
        rates: RateHistory | None = None,
        state_filter: StateFilter | None = None,
        learner: RateLearner | None = None,
        watch: TracerWatch | None = None,
    ) -> None:
        """Make the loop.

        Args:
            physics: the physics-based model.
            data_driven: the data-driven model, or `no_correction`.
            photo_interval: time between photographs [s]; how far a forecast looks ahead.
            controller: chooses setpoints; None: the twin predicts and does not control.
            rates: the history of the rates; None: the safe ones of the controller, or all off.
            state_filter: estimates the state from photograph and prediction; None: the state is the
                photograph, its unseen cells filled in (the paper's way).
            learner: learns the rate factors of the pumps, and needs a filter; None: they are 1.
            watch: compares the tracer in photographs with that of the pumps; None: nobody does.
        """
        self._watch = watch
        self._estimation = StateEstimation(state_filter, learner)
        self._plain_physics = physics
        self._learner = learner
        self._physics = physics
        if learner is not None:
            self._physics = DeliveringModel(physics, learner)
            data_driven = correcting_delivered(data_driven, learner)
        self._forecaster = Forecaster(self._physics, data_driven)
        self._photo_interval = photo_interval
        self._times: deque[float] = deque(maxlen=2 * LEARNING_PHOTOGRAPHS)
        self._longest_gap = LONGEST_GAP_INTERVALS * photo_interval
        self._rates = rates or RateHistory(controller.limits.safe() if controller else {})
        self.choice = SetpointChoice(photo_interval, self._rates)
        """Chooses setpoints, and takes back those that the asset rejects."""
        self.change_controller(controller)
        self._state: Observation | None = None
        self._forecast: Forecast | None = None
        self._learnt = NO_LEARNT_PHYSICS

    def interrupt(self) -> None:
        """Forget state and forecast: the next state does not follow from the last."""
        self._state = None
        self._forecast = None
        self._times.clear()
        if self._watch is not None:
            self._watch.forget()
        self._estimation.interrupt()
        if self._learner is not None:
            self._learner.interrupt()

    def begin_anew(self) -> None:
        """Forget everything but the rates in force: time went back."""
        self.interrupt()
        self._rates.begin_anew(-math.inf)
        self._learnt = NO_LEARNT_PHYSICS
        if self._learner is not None:
            self._learner.begin_anew()

    def change_model(self, mended: Rig) -> None:
        """Weigh tracer with the effects of the rig `mended` that the model has now.

        The rate factors are learnt anew: those of another model may stand for its error.
        """
        if self._learner is not None:
            self._learner.begin_anew()
        self._estimation.change_model(mended)
        if self._watch is not None:
            self._watch.change_rig(mended)

    @property
    def controls(self) -> bool:
        """Whether setpoints are chosen."""
        return self.choice.planner is not None

    @property
    def validity(self) -> float:
        """How long a setpoint is valid after its photograph [s]."""
        return self.choice.validity

    def change_controller(self, controller: Planner | None) -> None:
        """Choose setpoints by `controller` from now on; None: predict and do not control."""
        self.choice.planner = controller
        if controller is not None:
            self._rates.control_wells = controller.limits.wells

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
        if actuate:
            delivery = {name: found.factor for name, found in self._factors().items()}
            plant = PlantKnowledge(delivery, learnt=self._learnt)
            self.choice.choose(cycle, self._physics, began=self._rates.began or 0.0, plant=plant)
        return cycle

    def look_ahead(self, cycle: Cycle) -> None:
        """Judge the forecast of the observation, and forecast the next observation.

        A model that does not answer is a remark of the cycle.
        """
        self._judge(cycle)
        self._learn_rates(cycle)
        self._forecast_next(cycle)
        self._state = Observation(cycle.observation.time, cycle.state)
        self._forecast = cycle.forecast
        self._learnt = NO_LEARNT_PHYSICS if cycle.forecast is None else cycle.forecast.learnt
        self._estimation.expect(cycle)

    def _count_disallowed_tracer(self, cycle: Cycle) -> None:
        if self.choice.planner is not None:
            objective = self.choice.planner.objective
            cycle.disallowed_tracer = objective.disallowed_tracer(cycle.observation.concentration)

    def _begin(self, observation: Observation, known: Sequence[KnownRates]) -> Cycle:
        """Return a cycle with the rates in force, the elapsed forecast and the state estimate."""
        now = observation.time
        gap = now - self._state.time if self._state is not None else 0.0
        if gap > self._longest_gap:
            self.interrupt()
        self._rates.reach(now)
        commanded = self._rates.commanded(now)
        for item in known:
            self._rates.add_known(self._as_told(item, commanded))
        periods: tuple[RatePeriod, ...] = ()
        if self._state is not None:
            periods = to_predict(self._rates.periods(self._state.time, now))
        pumped = self._rates.until(now)
        self._rates.forget_before(now if self._state is None else self._state.time)
        cycle = Cycle(observation, observation.concentration, periods, pumped)
        self._times.append(now)
        if odd := odd_pace(self._times, self._photo_interval):
            cycle.remarks.append(str(odd))
        if gap > self._longest_gap:
            cycle.notes.append(f'interrupted: {gap:.0f} s without a photograph; none is predicted')
        if self._state is not None:
            self._forecast_elapsed(cycle, self._state)
        self._estimation.estimate_state(cycle)
        return cycle

    def _factors(self) -> dict[str, PumpFactor]:
        """Return the learnt share of its rate that each pump delivers, by well."""
        return self._learner.factors if self._learner is not None else {}

    def _forecast_elapsed(self, cycle: Cycle, last: Observation) -> None:
        """Set the forecast that was made for the observation, if there was one.

        It is made again if other rates were pumped than it assumed, or if the photograph came at
        another time.
        """
        planned = self._forecast
        if planned is None:
            return
        as_planned = not any(different_wells(one.rates, planned.rates) for one in cycle.periods)
        if as_planned and abs(planned.time - cycle.observation.time) <= SAME_PHOTOGRAPH_S:
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

    def _learn_rates(self, cycle: Cycle) -> None:
        """Learn the rate factors; a model that does not answer is a remark of the cycle."""
        estimate = self._estimation.estimate
        if self._learner is None or estimate is None or cycle.seen is None:
            return
        time = cycle.observation.time
        try:
            cycle.remarks += self._learner.learn(
                self._plain_physics, time, estimate, cycle.seen, cycle.periods
            )
        except ModelUnavailable as error:
            cycle.remarks.append(f'no rates learnt: {error}')
        cycle.rate_factors = self._learner.factors

    def _as_told(self, known: KnownRates, commanded: WellRates) -> KnownRates:
        """Return `known` rates as the pumps were told; measured ones teach the rate factors."""
        if self._learner is None or known.is_open:
            return known
        pauses = self._rates.pauses
        # a mean over the begin or the end of a pause tells nothing about a pump
        if not pauses.moments(known.start, known.end):
            self._learner.meter(known.rates, pauses.at(known.start, commanded))
        return known._replace(rates=self._learner.told(known.rates))

    def _judge(self, cycle: Cycle) -> None:
        """Compare the observation with its forecast, or with one made now for its time."""
        if self._state is None or not cycle.periods:
            return
        if self._watch is not None:
            seen = cycle.observation
            remark = self._watch.at_wells(seen.concentration, seen.time, cycle.periods)
            cycle.remarks += [str(remark)] if remark else []
        if cycle.elapsed is None:
            try:
                cycle.elapsed = self._forecaster.forecast(self._state.concentration, cycle.periods)
            except ModelUnavailable as error:
                cycle.remarks.append(f'no prediction for this photograph: {error}')
                if self._watch is not None:
                    self._watch.forget_amount()
                return
        cycle.prediction_error = relative_error(cycle.elapsed.predicted, cycle.observed)
        cycle.corrected_error = relative_error(cycle.elapsed.corrected, cycle.observed)
        if self._watch is not None:
            periods = cycle.periods
            factor = 1.0
            if self._learner is not None:
                factor = self._learner.tracer_factor(periods).factor
                periods = self._learner.metered(periods)
            remark = self._watch.amount(
                cycle.observation.concentration,
                self._state.concentration,
                cycle.elapsed.predicted,
                pumped=injected_tracer(periods),
                assumed=factor * injected_tracer(cycle.periods),
            )
            cycle.remarks += [str(remark)] if remark else []

    def _forecast_next(self, cycle: Cycle) -> None:
        now = cycle.observation.time
        planned = cycle.setpoint.rates if cycle.setpoint and cycle.accepted else cycle.pumped
        plan = self._rates.pauses.in_plan([RateStep(0.0, planned)], now, self._photo_interval)
        periods = to_predict(plan_periods(plan, now, self._photo_interval))
        try:
            cycle.forecast = self._forecaster.forecast(cycle.state, periods, cycle.durations)
        except ModelUnavailable as error:
            cycle.remarks.append(f'no forecast: {error}')
