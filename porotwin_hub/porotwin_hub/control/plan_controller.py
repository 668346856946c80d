"""The controller with foresight: a plan over the rest of the experiment, by gradients.

Every decision plans again over the whole remaining time, in blocks of growing length. It begins
with the rest of the last plan and with simple plans, improves the best one by the gradient, and
takes back orders that are not worth their cost. The plan runs on a coarse grid: dozens of long
simulations take a second there, and the smeared plume makes the cost smooth. On the grid of the
maps its limiters leave kinks, and a gradient search stops there.
"""

import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.units import MINUTE_S, from_ml_min
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.wells import RateStep, WellRate, WellRates, net_rate, with_rises
from porotwin_core.rig import Rig
from porotwin_core.rig.coarse_grid import coarse_grid
from porotwin_hub.control.control_plan import ControlPlan, growing_blocks, same
from porotwin_hub.control.optimisation import Decision, OutOfTimeError
from porotwin_hub.control.projected_gradient import descend
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.models.forecast import ModelUnavailable, PhysicsModel
from porotwin_hub.models.plant_knowledge import DEAD_SHARE, NOTHING_LEARNT, STANDS, PlantKnowledge
from porotwin_hub.objectives.objective import Objective
from porotwin_hub.objectives.objective_registry import make_objective

FIRST_STEPS, LATER_STEPS = 8, 3
"""Steps of the gradient search in the first decision, and in those that begin with a plan."""

FIRST_SEQUENCES, LATER_SEQUENCES = 12, 2
"""Plans "one well at its maximum, then another" tried in the first decision, and in later ones: an
hour tries all of them many times."""

SWITCHES = (0.25, 0.5, 0.75)
"""Shares of the blocks before such a plan goes over to the other well."""

JOININGS = 3
"""Orders tried to be taken back before the others stay."""


BUSY_S = 300.0
"""Every order costs once more for each order of so many seconds before it: a person who has just
walked to the pumps walks again for a good reason only."""


class PlanModel(Protocol):
    """The physics-based model that tells the cost of plans, on any grid not finer than its own."""

    def plan_cost(
        self,
        initial: FloatArray,
        plan: Sequence[RateStep],
        *,
        horizon: float,
        terms: Sequence[CostTerm],
        with_gradient: bool,
        learnt: LearntPhysics,
        patience: float,
    ) -> tuple[float, FloatArray | None]:
        """Return the cost of `plan` from `initial` (nz, nx) and, if asked for, its gradient.

        The gradient (steps, wells) is by the rates of all wells of the rig, in their order.
        `learnt` physics acts in the model.
        `patience` [s] bounds the wall-clock time.

        Raises:
            ModelUnavailable: the model does not answer in time.
        """
        ...


@dataclass
class LastPlan:
    """The plan of the last decision; kept between decisions.

    It was `asked` for at this time [s], and `begins` when its first order was expected to be set.
    """

    asked: float = -math.inf
    begins: float = -math.inf
    plan: ControlPlan | None = None
    turn: int = 0
    orders: tuple[float, ...] = ()
    """Times of the last orders [s]."""
    before: 'LastPlan | None' = None
    """The plan of the decision before, should the asset not take this one."""


@dataclass(frozen=True)
class PlanController:
    """Plans the rates over the rest of the experiment, and returns the ones for now.

    Attributes:
        limits: the rates that may be commanded.
        objective: its terms and its water are the cost of a plan [m^3 s].
        model: tells costs and gradients.
        cells: (nz, nx) of the grid of plans.
        horizon: how far a plan looks ahead where the end of the experiment is not known [s].
        interval: time between two setpoints [s].
        end: of the experiment, in the time of the states [s]; None: open.
        change_cost: of every order [m^3 s].
        patience: longest wall-clock time of a decision [s]; then the best plan so far is taken.
        pauses: announced pauses of the fixed wells, in the time of the states.
        last: the plan of the last decision.
    """

    limits: Limits
    objective: Objective
    model: PlanModel
    cells: tuple[int, int]
    horizon: float
    interval: float
    end: float | None
    change_cost: float
    patience: float
    pauses: FixedPauses
    last: LastPlan = field(default_factory=LastPlan, compare=False)

    def decide(
        self,
        _: PhysicsModel,
        state: FloatArray,
        previous: WellRates,
        *,
        now: float = 0.0,
        plant: PlantKnowledge = NOTHING_LEARNT,
    ) -> Decision:
        """Return the first rates of the best plan found, and the plan.

        Args:
            state: the state estimate (nz, nx) [-].
            previous: the rates of the setpoint in force.
            now: the time of the state since the start of the experiment [s].
            plant: knowledge of pumps, person and physics. The plan begins when an order of
                now will be set.

        Raises:
            ModelUnavailable: the model tells not even the cost of the last plan.
        """
        self.last.before = None
        begins = now + plant.ahead.lead
        if self.end is not None and begins >= self.end:
            return self._kept(state, previous)
        horizon = self._horizon(now)
        remembered = self.last.plan if now >= self.last.asked > -math.inf else None
        task = _Task(self, state, previous, now, horizon, self._expected(plant))
        first = remembered is None
        begin = task.hold
        if remembered is not None:
            task.standing = remembered.rates[0]
            begin = remembered.after(
                max(begins - self.last.begins, 0.0), horizon - plant.ahead.lead
            )
        recent = tuple(time for time in self.last.orders if 0.0 <= now - time < BUSY_S)
        task.recent_orders = len(recent)
        chosen = task.search(begin, turn=self.last.turn, first=first)
        self.last.before = replace(self.last, before=None)
        self.last.orders = (*recent, now) if task.is_new(chosen) else recent
        self.last.asked, self.last.begins, self.last.plan = now, begins, chosen
        self.last.turn += LATER_SEQUENCES
        return Decision(
            rates=self.limits.setpoint(chosen.rates[0], previous),
            cost=task.best_cost / horizon,
            cost_unchanged=task.hold_cost / horizon,
            evaluations=task.evaluations,
            plan=task.steps(chosen),
        )

    def take_back(self) -> None:
        """Go on from the decision before: an order that the asset refused was not given."""
        if self.last.before is not None:
            vars(self.last).update(vars(self.last.before))

    def _expected(self, plant: PlantKnowledge) -> PlantKnowledge:
        """Return the plant as it is planned with.

        A fixed well that stands is planned as running: a pause of the injection ends.
        """
        delivery = {
            name: 1.0 if name in self.limits.fixed and share <= STANDS else share
            for name, share in plant.delivery.items()
        }
        return replace(plant, delivery=delivery)

    def _kept(self, state: FloatArray, previous: WellRates) -> Decision:
        """Return the rates in force: at the end of the experiment no order is worth its cost."""
        rates = {name: previous.get(name, WellRate()) for name in self.limits.all_wells}
        cost = self.objective(state)
        if self.limits.violations(rates, previous):
            rates = self.limits.setpoint(self.limits.control_rates(previous), previous)
        plan = (RateStep(0.0, rates),)
        return Decision(rates, cost, cost_unchanged=cost, evaluations=0, plan=plan)

    def _horizon(self, now: float) -> float:
        """Return the time from `now` [s] to the end of the plan [s]."""
        return self.horizon if self.end is None else self.end - now


def plan_controller(
    rig: Rig,
    grid: Grid,
    model: PlanModel,
    *,
    horizon: float,
    interval: float,
    patience: float = math.inf,
) -> PlanController:
    """Return the controller of `rig.yaml` for maps on `grid`.

    Args:
        rig: the rig with its control section: limits, objective, cost of an order, end.
        grid: the grid of the maps.
        model: tells the cost of plans.
        horizon: how far a plan looks ahead without an end of the experiment [s].
        interval: time between photographs [s].
        patience: longest wall-clock time of a decision [s].

    Raises:
        InputError: the rig has no control section, or its objective is wrong.
    """
    limits, objective = Limits.of(rig), make_objective(rig, grid)
    assert rig.control is not None
    end_min = rig.control.end_min
    return PlanController(
        limits,
        objective,
        model,
        cells=coarse_grid(rig, grid).shape,
        horizon=horizon,
        interval=interval,
        end=None if end_min is None else MINUTE_S * end_min,
        change_cost=from_ml_min(rig.control.change_cost_ml_min),
        patience=patience,
        pauses=FixedPauses.of(rig),
    )


class _Task:
    """One decision: the costs of plans, and the best plan so far."""

    def __init__(
        self,
        controller: PlanController,
        state: FloatArray,
        previous: WellRates,
        now: float,
        horizon: float,
        plant: PlantKnowledge,
    ) -> None:
        self._limits, self._model = controller.limits, controller.model
        self._water_cost = controller.objective.water_cost
        self._change_cost, self._interval = controller.change_cost, controller.interval
        self._lead = plant.ahead.lead
        self._whole, self._horizon = horizon, horizon - self._lead
        self._previous, self._plant = previous, plant
        self._now, self._pauses = now, controller.pauses
        self._deadline = time.monotonic() + controller.patience
        self._state = conservative_resample(state, controller.cells)
        terms = controller.objective.terms(now, horizon)
        self._terms = [term.on_cells(controller.cells) for term in terms]
        self._shares = np.array([plant.delivery.get(name, 1.0) for name in self._limits.wells])
        self._greatest = np.where(self._shares < DEAD_SHARE, 0.0, self._limits.max_rate)
        self._before = self._limits.control_rates(previous)
        self.standing = self._before
        """The last order (wells,) [m^3/s]: it costs nothing to repeat, set or not."""
        held = np.minimum(self._before, self._greatest)
        self.hold = ControlPlan.constant(held, self._horizon)
        self.recent_orders = 0
        """Orders of the last BUSY_S."""
        self.hold_cost = math.nan
        self.best_cost = math.inf
        self.best = self.hold
        self.evaluations = 0

    def search(self, begin: ControlPlan, *, turn: int, first: bool) -> ControlPlan:
        """Return the stages of the best plan found from `begin` and from simple plans.

        Raises:
            ModelUnavailable: not even the cost of `begin` is known.
        """
        blocks = growing_blocks(self._horizon, begin.starts)
        self._try(begin)
        with suppress(OutOfTimeError, ModelUnavailable):
            self.hold_cost = self._try(self.hold)
            for plan in self._simple_plans():
                self._try(plan)
            count = FIRST_SEQUENCES if first else LATER_SEQUENCES
            for plan in itertools.islice(self._sequences(blocks), turn, turn + count):
                self._try(plan)
            improved = descend(
                self._gradient_on(blocks),
                self.best.on_blocks(blocks).rates,
                lengths=np.diff(np.append(blocks, self._horizon)),
                greatest=self._greatest,
                total=self._limits.max_total_rate,
                iterations=FIRST_STEPS if first else LATER_STEPS,
            )
            self._with_fewer_orders(ControlPlan(blocks, improved, self._horizon))
        return self.best

    def is_new(self, plan: ControlPlan) -> bool:
        """Return whether a plan begins with an order: rates that are neither set nor ordered."""
        return not any(same(plan.rates[0], rates) for rates in self._free())

    def _free(self) -> tuple[FloatArray, ...]:
        """Return the rates (wells,) that need no new order: ordered before, or else set."""
        return (self._before,) if self._plant.ahead.waits else (self._before, self.standing)

    def _orders(self, plan: ControlPlan) -> int:
        """Return the orders of a plan; one that follows others soon counts more than once."""
        count = min(plan.orders(rates) for rates in self._free())
        return count + self.recent_orders * self.is_new(plan)

    def steps(self, plan: ControlPlan) -> tuple[RateStep, ...]:
        """Return the rates of all wells from the state on, under an executable plan."""
        planned = (
            RateStep(self._lead + float(start), self._limits.setpoint(rates))
            for start, rates in zip(plan.starts, plan.rates, strict=True)
        )
        return (*self._plant.ahead.steps, *planned)

    def _simple_plans(self) -> Iterator[ControlPlan]:
        """Yield constant plans: no control, and each well alone at its maximum."""
        for rates in [np.zeros(len(self._limits.wells)), *self._alone()]:
            yield ControlPlan.constant(rates, self._horizon)

    def _alone(self) -> FloatArray:
        """Return rates with one well at its maximum, a row for each (wells, wells) [m^3/s]."""
        return np.diag(np.minimum(self._greatest, self._limits.max_total_rate))

    def _sequences(self, blocks: FloatArray) -> Iterator[ControlPlan]:
        """Yield endlessly the plans of one well at its maximum, then another one or none."""
        ends = [np.zeros(len(self._limits.wells)), *self._alone()]
        pairs = [(a, b) for a, b in itertools.product(ends, ends) if (a != b).any()]
        switches = sorted({blocks[int(share * len(blocks))] for share in SWITCHES} - {0.0})
        plans = [
            ControlPlan(np.array([0.0, switch]), np.array([early, late]), self._horizon)
            for switch in switches
            for early, late in pairs
        ]
        return itertools.cycle(plans) if plans else iter(())

    def _with_fewer_orders(self, plan: ControlPlan) -> None:
        """Try `plan` and the plans that take back one order after the other, the easiest first."""
        plan = plan.executable(self._limits, self._previous, self._interval).stages()
        cost = self._try(plan)
        while True:
            for number in plan.easiest_changes(self._before)[:JOININGS]:
                joined = plan.without_change(number, self._before).stages()
                joined = joined.executable(self._limits, self._previous, self._interval)
                joined_cost = self._try(joined)
                fewer = joined.orders(self._before) < plan.orders(self._before)
                if fewer and joined_cost <= cost:
                    plan, cost = joined, joined_cost
                    break
            else:
                return

    def _try(self, plan: ControlPlan) -> float:
        """Return the cost of a plan as the pumps can be set, with its orders; keep the best.

        Raises:
            OutOfTimeError: the time is over.
            ModelUnavailable: the model does not answer.
        """
        plan = plan.executable(self._limits, self._previous, self._interval).stages()
        cost = self._cost(plan, with_gradient=False)[0]
        cost += self._change_cost * self._orders(plan)
        if cost < self.best_cost:
            self.best, self.best_cost = plan, cost
        return cost

    def _gradient_on(self, blocks: FloatArray) -> Callable[[FloatArray], tuple[float, FloatArray]]:
        """Return the function from rates (blocks, wells) to cost and derivatives."""

        def evaluate(rates: FloatArray) -> tuple[float, FloatArray]:
            return self._cost(ControlPlan(blocks, rates, self._horizon), with_gradient=True)

        return evaluate

    def _cost(self, plan: ControlPlan, *, with_gradient: bool) -> tuple[float, FloatArray]:
        """Return the cost of tracer and water [m^3 s], and the derivatives by control rates.

        Raises:
            OutOfTimeError: the time is over.
            ModelUnavailable: the model does not answer.
        """
        left = self._deadline - time.monotonic()
        if self.evaluations and left <= 0.0:
            raise OutOfTimeError
        self.evaluations += 1
        ahead = self._plant.ahead.steps
        starts = np.array([*(step.start for step in ahead), *(self._lead + plan.starts)])
        rates = [*(self._limits.control_rates(step.rates) for step in ahead), *plan.rates]
        moments, stages = self._with_pauses(starts)
        steps = [
            RateStep(float(low), self._delivered(rates[stage], float(low), float(high)))
            for low, high, stage in zip(moments, [*moments[1:], self._whole], stages, strict=True)
        ]
        cost, by_rate = self._model.plan_cost(
            self._state,
            steps,
            horizon=self._whole,
            terms=self._terms,
            with_gradient=with_gradient,
            learnt=self._plant.learnt,
            patience=max(left, 0.0),
        )
        lengths = plan.lengths
        cost += self._water_cost * float(lengths @ plan.rates.sum(axis=1))
        if by_rate is None:
            return cost, np.zeros(plan.rates.shape)
        by_stage = np.zeros((len(starts), by_rate.shape[1]))
        np.add.at(by_stage, stages, by_rate)
        wells, by_rate = self._limits.all_wells, by_stage[len(ahead) :]
        by_control = by_rate[:, [wells.index(name) for name in self._limits.wells]]
        if self._limits.producer is not None:
            by_control = by_control - by_rate[:, [wells.index(self._limits.producer)]]
        return cost, self._shares * by_control + self._water_cost * lengths[:, None]

    def _with_pauses(self, starts: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return when any rate changes, and the stage that holds from then on.

        Announced pauses and levels divide the stages that begin at `starts` [s] after the state,
        (stages,).
        """
        end = self._now + self._whole
        edges = self._pauses.moments(self._now, end).union(
            self._pauses.levels.moments(self._now, end)
        )
        moments = np.union1d(starts, [edge - self._now for edge in edges])
        return moments, np.searchsorted(starts, moments, side='right') - 1

    def _delivered(
        self, control_rates: FloatArray, moment: float, end: float
    ) -> dict[str, WellRate]:
        """Return the delivered rates for `control_rates` (wells,), balanced by the producer.

        The fixed wells rest that pause at that `moment` after the state [s], and the levels of
        water are those until the `end`.
        """
        limits, resting = self._limits, self._pauses.resting(self._now + moment)
        commanded = {
            **dict.fromkeys(limits.all_wells, WellRate()),
            **limits.fixed,
            **dict.fromkeys(resting, WellRate()),
            **{
                name: WellRate(float(rate))
                for name, rate in zip(limits.wells, control_rates, strict=True)
            },
        }
        delivered = {
            name: WellRate(well.rate * self._plant.delivery.get(name, 1.0), well.concentration)
            for name, well in commanded.items()
        }
        if limits.producer is not None:
            delivered[limits.producer] = WellRate(-net_rate(delivered))
        rises = self._pauses.levels.mean(self._now + moment, self._now + end)
        return with_rises(delivered, rises)
