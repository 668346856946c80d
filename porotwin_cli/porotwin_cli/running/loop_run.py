"""One simulated experiment: a scenario under one controller, from takeover to end."""

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from porotwin_cli.running.loop_operator import OperatorAtWork
from porotwin_cli.running.loop_rig import Eyes, LoopRig, LoopSettings
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_core.basis.errors import InputError
from porotwin_core.model.state_filter import StateFilter
from porotwin_core.rates.delivered_rates import rate_deviations
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import OPEN_HORIZON_S, KnownRates, orders_by_hand
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_guard.guard import Guard, SetpointRequest
from porotwin_hub.control.plan_controller import PlanModel, plan_controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.estimation.rate_learning import RateLearner
from porotwin_hub.estimation.tracer_watch import TracerWatch
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import PhysicsModel, no_correction
from porotwin_hub.operator.setpoint_expiry import SetpointDecision
from porotwin_rig.limits import refuse_broken_limits
from porotwin_solver.adjoint.grid_models import GridModels
from porotwin_solver.effects import tracer_storage

PLAN_PRESET = 'fast'
"""Numerical scheme of plans on their coarser grid, as the solver's node has it."""


@dataclass(frozen=True)
class LoopFigures:
    """The figures of one run.

    Attributes:
        dose_ml_min: tracer where it must not be, integrated over time [ml min].
        end_ml: the same at the end [ml].
        water_ml: water that the control wells injected [ml].
        orders: setpoints that differ from the one before.
        violations: setpoints that break a limit, by the guard's and the rig's own checks.
        model_runs: predictions and gradients that the decisions asked for.
        decision_s: median wall-clock time of a decision [s]; NaN without decisions.
        decision_p99_s: 99 % of the decisions took less [s].
        course_ml: tracer where it must not be at every photograph [ml].
    """

    dose_ml_min: float
    end_ml: float
    water_ml: float
    orders: int = 0
    violations: int = 0
    model_runs: int = 0
    decision_s: float = math.nan
    decision_p99_s: float = math.nan
    course_ml: list[float] = field(default_factory=list)


MakeTwin = Callable[[LoopScenario, LoopSettings], Twin]
"""Makes the twin with its controller for a scenario."""


class LoopModels(PlanModel, Protocol):
    """The models of a loop: of plans, and `own` of one interval."""

    @property
    def own(self) -> PhysicsModel:
        """The model of one interval."""
        ...


def planning_twin(
    scenario: LoopScenario, settings: LoopSettings, models: LoopModels | None = None
) -> Twin:
    """Return the loop of this program, as the hub makes it.

    It plans over the rest of the experiment, filters the state and learns the rates of the pumps.

    The end of the experiment and the pauses of the injection are known, as a laboratory knows them.
    `models` replace the models of the scenario's rig.
    """
    grid = settings.grid(scenario)
    rig = with_plan(scenario)
    models = models or GridModels(rig, grid, preset=settings.preset, coarse_preset=PLAN_PRESET)
    return Twin(
        models.own,
        no_correction,
        photo_interval=scenario.photo_interval,
        controller=plan_controller(
            rig, grid, models, horizon=OPEN_HORIZON_S, interval=scenario.photo_interval
        ),
        rates=RateHistory.of(rig, 0.0),
        state_filter=StateFilter(tracer_storage(rig, grid), (grid.dz, grid.dx)),
        learner=RateLearner(rate_deviations(rig), grid, closed=rig.closed),
        watch=TracerWatch(rig, grid),
    )


def with_plan(scenario: LoopScenario) -> Rig:
    """Return the rig of a scenario with its end and the pauses of its fixed wells.

    A laboratory plans these itself, so they are no secrets.
    """
    control = scenario.rig.control
    assert control is not None
    fixed = {
        name: well.model_copy(update={'pauses_min': _pauses_min(scenario, name)})
        for name, well in control.fixed.items()
    }
    told = control.model_copy(update={'end_min': scenario.end / 60.0, 'fixed': fixed})
    return scenario.rig.model_copy(update={'control': told})


def _pauses_min(scenario: LoopScenario, well: str) -> tuple[tuple[float, float], ...]:
    """Return the pauses of a well that end again [min]."""
    return tuple(
        (fault.start / 60.0, fault.end / 60.0)
        for fault in scenario.faults
        if fault.well == well and fault.share == 0.0 and math.isfinite(fault.end)
    )


def figures_of(rig: LoopRig, **others: float) -> LoopFigures:
    """Return the figures of a rig after its experiment, with `others` by name."""
    found = LoopFigures(rig.dose_ml_min, rig.end_ml, rig.water_ml, course_ml=rig.course_ml)
    return LoopFigures(**{**found.__dict__, **others})


def run_closed(
    scenario: LoopScenario, settings: LoopSettings, eyes: Eyes, make_twin: MakeTwin
) -> LoopFigures:
    """Return the figures of a scenario in closed loop."""
    rig, twin = LoopRig(scenario, settings), make_twin(scenario, settings)
    limits = Limits.of(scenario.rig)
    judge = _Judge(scenario)
    operator = OperatorAtWork(scenario.operator, limits, seed=scenario.seed)
    known: list[KnownRates] = []
    model_runs, seconds = 0, []
    while not rig.is_over:
        cycle = twin.decide(rig.seen(eyes), known)
        assert cycle.setpoint is not None
        judge.see(cycle.setpoint, rig.time)
        seconds.append(cycle.durations['optimise'])
        model_runs += cycle.decision.evaluations if cycle.decision else 0
        twin.look_ahead(cycle)
        known = _pumped(rig, operator, cycle.setpoint.rates, meters=scenario.meters)
    return figures_of(
        rig,
        orders=judge.orders,
        violations=judge.violations,
        model_runs=model_runs,
        decision_s=statistics.median(seconds),
        decision_p99_s=float(np.percentile(seconds, 99)),
    )


def _pumped(
    rig: LoopRig, operator: OperatorAtWork, order: WellRates, *, meters: bool
) -> list[KnownRates]:
    """Let the operator follow `order` and the rig run on; return the rates told to the twin."""
    begin = rig.time
    rates, are_new = operator.follow(order)
    delivered = rig.advance(rates)
    if meters:
        return [KnownRates(begin, rig.time, delivered)]
    return [KnownRates(begin, begin, dict(rates))] if are_new else []


class _Judge:
    """Counts orders, and setpoints that break a limit; guard and rig check them without the hub."""

    def __init__(self, scenario: LoopScenario) -> None:
        self.violations = 0
        self._guard = Guard(scenario.rig, photo_interval=scenario.photo_interval)
        self._scenario = scenario
        self._setpoints: list[WellRates] = []

    @property
    def orders(self) -> int:
        """Number of the setpoints that a person has to set."""
        return orders_by_hand(self._setpoints, self._scenario.rig)

    def see(self, setpoint: SetpointDecision, time: float) -> None:
        """Take a setpoint for the photograph at `time` [s]."""
        self._setpoints.append(setpoint.rates)
        now = max(time, 1.0)  # the guard takes zero for a clock that stands still
        request = SetpointRequest(
            len(self._setpoints), time, setpoint.valid_until, setpoint.rates, 'bench'
        )
        try:
            self._guard.check(request, now=now)
            refuse_broken_limits(self._scenario.rig, setpoint.rates)
        except InputError:
            self.violations += 1
