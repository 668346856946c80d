"""Tests of the controller that plans, on a model whose best plan is known."""

import dataclasses
import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hub_examples import LIMITS, ToyModel

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.order_delay import OrdersAhead
from porotwin_core.rates.water_levels import Rises, WaterLevels
from porotwin_core.rates.wells import RateStep, WellRate, WellRates, net_rate
from porotwin_core.rig import EffectDescription
from porotwin_hub.control.controller import Controller, WithSubstitute
from porotwin_hub.control.plan_controller import PlanController
from porotwin_hub.models.forecast import ModelUnavailable
from porotwin_hub.models.plant_knowledge import PlantKnowledge
from porotwin_hub.objectives.objective import WeightedTracer

SHAPE = (2, 3)
STATE = np.zeros(SHAPE)
END = 4800.0
SWITCH = 3000.0
FULL = from_ml_h(500.0)
OBJECTIVE = WeightedTracer('test', np.ones(SHAPE), np.ones(SHAPE))


class TwoStages:
    """A cost that falls with control1 until SWITCH and with control3 afterwards.

    cost = integral of 1 - u1 / FULL before SWITCH, 1 - u3 / FULL after it; u2 only costs.
    """

    def __init__(self) -> None:
        self.calls = 0
        self.now = 0.0
        self.slow = 0.0
        self.answers = math.inf
        self.rates: list[WellRates] = []
        self.learnt = LearntPhysics()

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
        assert initial.shape == SHAPE
        assert terms[0].end == horizon
        assert patience >= 0.0
        self.learnt = learnt
        self.calls += 1
        if self.calls > self.answers:
            raise ModelUnavailable('the solver does not answer; start it')
        time.sleep(self.slow)
        wells = list(LIMITS.all_wells)
        gradient = np.zeros((len(plan), len(wells)))
        cost = 0.0
        ends = [step.start for step in plan[1:]] + [horizon]
        for number, (step, end) in enumerate(zip(plan, ends, strict=True)):
            self.rates.append(step.rates)
            early = max(0.0, min(end, SWITCH - self.now) - step.start)
            late = end - step.start - early
            weights = {'control1': -early, 'control3': -late, 'control2': end - step.start}
            cost += end - step.start
            for name, weight in weights.items():
                cost += weight * step.rates[name].rate / FULL
                gradient[number, wells.index(name)] = weight / FULL
        return cost, gradient if with_gradient else None


def controller(model: TwoStages, **changes: Any) -> PlanController:
    given = PlanController(
        LIMITS, OBJECTIVE, model, SHAPE, 1800.0, 30.0, END, 10.0, math.inf, NO_PAUSES
    )
    return dataclasses.replace(given, **changes)


def control_ml_h(rates: WellRates) -> list[float]:
    return [round(to_ml_h(rates[name].rate), 1) for name in LIMITS.wells]


def run(planner: PlanController, model: TwoStages) -> list[tuple[float, list[float]]]:
    """Return the orders of a whole run: their times [s] and control rates [ml/h]."""
    previous, orders = LIMITS.safe(), []
    for now in np.arange(0.0, END, 60.0):
        model.now = float(now)
        decision = planner.decide(ToyModel(), STATE, previous, now=float(now))
        assert LIMITS.violations(decision.rates, previous) == []
        if decision.rates != previous:
            orders.append((float(now), control_ml_h(decision.rates)))
        previous = decision.rates
    return orders


def test_a_run_takes_two_orders_at_the_right_times() -> None:
    model = TwoStages()
    orders = run(controller(model), model)
    assert [rates for _, rates in orders] == [[500.0, 0.0, 0.0], [0.0, 0.0, 500.0]]
    assert [time for time, _ in orders] == [0.0, pytest.approx(SWITCH, abs=60.0)]


def test_the_decision_carries_the_whole_plan() -> None:
    decision = controller(TwoStages()).decide(ToyModel(), STATE, LIMITS.safe())
    assert decision.plan[0].start == 0.0
    assert decision.plan[0].rates == decision.rates
    assert control_ml_h(decision.plan[-1].rates) == [0.0, 0.0, 500.0]
    assert decision.cost < decision.cost_unchanged == pytest.approx(1.0)


def test_learnt_physics_acts_in_every_plan() -> None:
    model, learnt = (
        TwoStages(),
        LearntPhysics(
            (EffectDescription(name='buoyancy', parameters={'density_difference': 0.8}),)
        ),
    )
    controller(model).decide(ToyModel(), STATE, LIMITS.safe(), plant=PlantKnowledge(learnt=learnt))
    assert model.learnt == learnt


def test_an_order_that_is_not_worth_its_cost_is_not_given() -> None:
    model = TwoStages()
    assert run(controller(model, change_cost=1e9), model) == []


def test_rates_ramp_where_they_may_not_jump() -> None:
    model = TwoStages()
    slow = dataclasses.replace(LIMITS, max_change=from_ml_h(200.0))
    planner = controller(model, limits=slow)
    previous = slow.safe()
    reached = []
    for number in range(3):
        decision = planner.decide(ToyModel(), STATE, previous, now=30.0 * number)
        assert slow.violations(decision.rates, previous) == []
        previous = decision.rates
        reached.append(control_ml_h(previous)[0])
    assert reached == [200.0, 400.0, 500.0]


def test_a_failed_well_is_left_out_and_the_plan_uses_what_pumps_deliver() -> None:
    model = TwoStages()
    decision = controller(model).decide(
        ToyModel(), STATE, LIMITS.safe(), plant=PlantKnowledge({'control1': 0.2, 'control3': 0.5})
    )
    assert all(control_ml_h(step.rates)[0] == 0.0 for step in decision.plan)
    most = max(rates['control3'].rate for rates in model.rates)
    assert most == pytest.approx(0.5 * FULL)


def test_an_order_that_nobody_has_set_yet_is_repeated() -> None:
    model = TwoStages()
    planner, asked = controller(model), []
    for now in (0.0, 60.0, 120.0):
        model.now = now
        decision = planner.decide(ToyModel(), STATE, LIMITS.safe(), now=now)
        asked.append(control_ml_h(decision.rates))
    assert asked == [[500.0, 0.0, 0.0]] * 3


def test_orders_to_a_late_person_are_given_in_time() -> None:
    model = TwoStages()
    planner, previous = controller(model), LIMITS.setpoint(np.array([FULL, 0.0, 0.0]))
    ahead = OrdersAhead(240.0, (RateStep(0.0, previous),))
    asked = []
    for now in np.arange(2400.0, SWITCH + 1.0, 60.0):
        model.now = float(now)
        decision = planner.decide(
            ToyModel(), STATE, previous, now=float(now), plant=PlantKnowledge(ahead=ahead)
        )
        asked.append((float(now), control_ml_h(decision.rates)))
    first = next(time for time, rates in asked if rates == [0.0, 0.0, 500.0])
    assert first == pytest.approx(SWITCH - 240.0, abs=60.0)


def test_an_order_that_waits_is_the_base_of_the_next_one() -> None:
    model, waiting = TwoStages(), LIMITS.setpoint(np.array([0.0, FULL, 0.0]))
    ahead = OrdersAhead(waits=True)
    held = controller(model, change_cost=1e9).decide(
        ToyModel(), STATE, waiting, plant=PlantKnowledge(ahead=ahead)
    )
    assert held.rates == waiting


def test_an_order_soon_after_another_costs_more() -> None:
    model = TwoStages()
    planner = controller(model, change_cost=1000.0)
    planner.last.orders = (0.0,) * 10
    decision = planner.decide(ToyModel(), STATE, LIMITS.safe(), now=60.0)
    assert decision.rates == LIMITS.safe()
    assert (
        controller(model, change_cost=1000.0)
        .decide(ToyModel(), STATE, LIMITS.safe(), now=60.0)
        .rates
        != LIMITS.safe()
    )


def test_an_order_that_the_asset_refused_leaves_no_trace() -> None:
    planner = controller(TwoStages())
    planner.decide(ToyModel(), STATE, LIMITS.safe(), now=0.0)
    known = dataclasses.replace(planner.last, before=None)
    planner.decide(ToyModel(), STATE, LIMITS.safe(), now=30.0)
    assert planner.last.asked == 30.0
    planner.take_back()
    assert dataclasses.replace(planner.last, before=None) == known


def test_rates_in_force_beyond_the_limits_do_not_stop_the_search() -> None:
    model = TwoStages()
    safe = LIMITS.safe()
    beyond = {**safe, 'control1': WellRate(5.0 * FULL), 'producer': WellRate(-6.0 * FULL)}
    decision = controller(model).decide(ToyModel(), STATE, beyond)
    assert LIMITS.violations(decision.rates) == []
    assert model.calls < 500


def test_an_announced_pause_acts_in_every_plan_and_changes_no_order() -> None:
    told, untold = TwoStages(), TwoStages()
    pauses = FixedPauses({'injector': ((600.0, 1200.0), (4000.0, 4100.0))})
    decided = controller(told, pauses=pauses).decide(ToyModel(), STATE, LIMITS.safe())
    usual = controller(untold).decide(ToyModel(), STATE, LIMITS.safe())
    assert decided.plan == usual.plan  # this cost knows no injector, and gradients add up
    assert {rates['injector'].rate for rates in told.rates} == {0.0, LIMITS.fixed['injector'].rate}
    assert all(net_rate(rates) == pytest.approx(0.0, abs=1e-20) for rates in told.rates)


def test_a_pause_of_the_injection_is_planned_to_end() -> None:
    model = TwoStages()
    controller(model).decide(
        ToyModel(), STATE, LIMITS.safe(), plant=PlantKnowledge({'injector': 0.02})
    )
    assert {rates['injector'].rate for rates in model.rates} == {LIMITS.fixed['injector'].rate}


def test_an_answer_is_there_when_the_time_is_over() -> None:
    model = TwoStages()
    model.slow = 0.01
    decision = controller(model, patience=0.05).decide(ToyModel(), STATE, LIMITS.safe())
    assert model.calls <= 8
    assert LIMITS.violations(decision.rates) == []


def test_the_best_plan_so_far_counts_when_the_model_falls_silent() -> None:
    model = TwoStages()
    model.answers = 4
    decision = controller(model).decide(ToyModel(), STATE, LIMITS.safe())
    assert control_ml_h(decision.rates) == [500.0, 0.0, 0.0]


def test_constant_rates_are_searched_where_plans_have_no_model() -> None:
    model = TwoStages()
    model.answers = 0
    constant = Controller(LIMITS, OBJECTIVE, horizon=600.0, evaluations=20)
    decision = WithSubstitute(controller(model), constant).decide(ToyModel(), STATE, LIMITS.safe())
    assert decision.remark.startswith('constant rates instead of a plan: the solver does not')
    assert decision.plan == ()
    physics = ToyModel()
    physics.available = False
    with pytest.raises(ModelUnavailable):
        WithSubstitute(controller(model), constant).decide(physics, STATE, LIMITS.safe())


def test_constant_rates_are_judged_by_the_mean_of_announced_pauses_and_levels() -> None:
    seen: list[WellRates] = []

    class Seeing(ToyModel):
        def predict(self, concentration: FloatArray, rates: WellRates, step: float) -> FloatArray:
            seen.append(rates)
            return super().predict(concentration, rates, step)

    pauses = FixedPauses(
        {'injector': ((0.0, 300.0),)},
        levels=WaterLevels({'left': Rises((0.0, 600.0), (0.0, 0.01))}),
    )
    constant = Controller(LIMITS, OBJECTIVE, horizon=600.0, evaluations=20, pauses=pauses)
    full = LIMITS.fixed['injector'].rate
    for now, share, rise in ((0.0, 0.5, 0.005), (600.0, 1.0, 0.01)):
        seen.clear()
        decision = constant.decide(Seeing(), STATE, LIMITS.safe(), now=now)
        assert seen
        for rates in seen:
            assert rates['left'].rise == pytest.approx(rise)
            assert rates['injector'].rate == pytest.approx(share * full)
        assert LIMITS.violations(decision.rates) == []


def test_water_is_saved_where_it_costs_more_than_it_is_worth() -> None:
    model = TwoStages()
    dear = dataclasses.replace(OBJECTIVE, water_cost=2.0 / FULL)
    decision = controller(model, objective=dear).decide(ToyModel(), STATE, LIMITS.safe())
    assert control_ml_h(decision.rates) == [0.0, 0.0, 0.0]


@pytest.mark.parametrize('late', [0.0, 1000.0])
def test_the_rates_stay_at_the_end_of_the_experiment_and_after_it(late: float) -> None:
    model = TwoStages()
    previous = LIMITS.setpoint(np.array([0.0, 0.0, FULL]))
    decision = controller(model).decide(ToyModel(), STATE, previous, now=END + late)
    assert decision.rates == previous
    assert [step.rates for step in decision.plan] == [previous]
    assert model.calls == 0


def test_the_rates_that_stay_name_all_wells_beside_a_meter_of_one() -> None:
    metered = {'injector': LIMITS.safe()['injector']}
    open_side = dataclasses.replace(LIMITS, producer=None)
    planner = dataclasses.replace(controller(TwoStages()), limits=open_side)
    decision = planner.decide(ToyModel(), STATE, metered, now=END)
    assert decision.rates.keys() == LIMITS.safe().keys()
    assert decision.rates['injector'] == metered['injector']
