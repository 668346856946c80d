"""The node of the siblings, called over DDS in the same process."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patience import PATIENCE_S, until

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S, MINUTE_S, from_ml_h
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import EffectDescription, Rig, load_rig

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rclpy.parameter import Parameter  # noqa: E402

from porotwin_core.ros import (  # noqa: E402
    conversions,
    qos,
)
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_msgs.msg import CycleReport, Forecast, ModelEffects, NewState, Outcome, Setpoint  # noqa: E402
from porotwin_msgs.srv import CostGradient, WhatIf  # noqa: E402
from porotwin_siblings.photograph import Photograph  # noqa: E402
from porotwin_siblings.siblings import Siblings  # noqa: E402
from porotwin_siblings.siblings_node import SiblingsNode  # noqa: E402

pytestmark = pytest.mark.graph

RIG = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'


class Beside:
    """The node, and another one that stands for all its neighbours, the solver among them."""

    def __init__(self, domain: int) -> None:
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        given: dict[str, Any] = {
            'rig': str(RIG),
            'grid': '40x24',
            'cells': 330,
            'horizon_s': 1200.0,
            'use_sim_time': True,  # so that stamps of any time are believed
        }
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        self.node = SiblingsNode(context=context, parameter_overrides=overrides)
        self.other = rclpy.create_node('player', context=context)  # it may send everything
        self.forecasts: list[Forecast] = []
        self.other.create_subscription(
            Forecast, 'siblings/forecast', self.forecasts.append, qos.FIELD
        )
        self.states = self.other.create_publisher(NewState, 'asset/new_state', qos.FIELD)
        self.setpoints = self.other.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
        self.effects = self.other.create_publisher(ModelEffects, 'model/effects', qos.CONFIG)
        self.cycles = self.other.create_publisher(CycleReport, 'hub/cycle', qos.FIELD)
        self.client = self.other.create_client(WhatIf, 'siblings/what_if')
        self.judges = self.other.create_client(CostGradient, 'siblings/cost_gradient')
        self._thread = NodeThread(self.node, self.other, threads=4)

    def photograph(self, stamp: float, concentration: Any) -> None:
        grid = load_rig(RIG).grid(40, 24)
        tracer = conversions.tracer_to_msg(concentration, grid, stamp)
        self.states.publish(NewState(header=tracer.header, tracer=tracer))

    def command(self, stamp: float, **rates_ml_h: float) -> None:
        rates = {name: WellRate(from_ml_h(rate)) for name, rate in rates_ml_h.items()}
        message = Setpoint(header=conversions.header_at(stamp))
        message.valid_until = conversions.time_to_msg(2.1e9)  # it outlasts all jumps of the clock
        message.wells = conversions.rates_to_msg(rates)
        self.setpoints.publish(message)

    def ask(self, plan: list[RateStep], horizon: float) -> WhatIf.Response:
        request = WhatIf.Request(
            proposed=conversions.plan_to_msg(plan), horizon=conversions.duration_to_msg(horizon)
        )
        future = self.client.call_async(request)
        until(future.done)
        return future.result()

    def judge(self, plan: list[RateStep], concentration: Any) -> CostGradient.Response:
        """Ask for the expected tracer in the upper half over ten minutes."""
        grid = load_rig(RIG).grid(40, 24)
        weights = np.zeros(grid.shape)
        weights[12:] = load_rig(RIG).cell_pore_volume(grid)[12:]
        request = CostGradient.Request(
            initial=conversions.tracer_to_msg(concentration, grid, 0.0),
            schedule=conversions.plan_to_msg(plan),
            horizon=conversions.duration_to_msg(600.0),
            terms=[conversions.cost_term_to_msg(CostTerm(0.0, 600.0, linear=weights))],
            with_gradient=True,
        )
        future = self.judges.call_async(request)
        until(future.done)
        return future.result()

    def close(self) -> None:
        self._thread.end()


@pytest.fixture
def beside(domain: int) -> Iterator[Beside]:
    both = Beside(domain)
    yield both
    both.close()


def test_photographs_lead_to_forecasts_and_a_proposal_is_answered(beside: Beside) -> None:
    assert beside.client.wait_for_service(timeout_sec=PATIENCE_S)
    early = beside.ask([], 600.0)
    assert early.outcome.code == Outcome.INVALID_INPUT
    assert 'no photograph' in early.outcome.message
    assert 'no forecast' in beside.judge([], np.zeros((24, 40))).outcome.message

    until(lambda: beside.states.get_subscription_count() > 0)
    until(lambda: beside.setpoints.get_subscription_count() > 0)
    plume = np.zeros((24, 40))
    plume[8:18, 5:20] = 1.0
    beside.command(0.0, control1=100.0, producer=-100.0)
    beside.photograph(0.0, plume)
    until(lambda: len(beside.forecasts) == 1)
    forecast = beside.forecasts[0]
    assert len(forecast.times) == len(forecast.zone_area) == len(forecast.zone_reached)
    low, middle, high = forecast.zone_area_low, forecast.zone_area, forecast.zone_area_high
    assert all(a <= b <= c for a, b, c in zip(low, middle, high, strict=True))
    assert [step.start for step in conversions.plan_from_msg(forecast.schedule)] == [0.0]
    assert all(well.well in forecast.water for well in forecast.schedule[0].wells if well.rate)
    assert len(forecast.mean) == len(forecast.deviation) == len(forecast.map_times)

    flush = {'control1': WellRate(from_ml_h(500.0)), 'producer': WellRate(-from_ml_h(500.0))}
    answer = beside.ask([RateStep(0.0, flush)], 1200.0)
    assert answer.outcome.code == Outcome.OK, answer.outcome.message
    assert not answer.outcome.message
    np.testing.assert_allclose(answer.present.zone_tracer, forecast.zone_tracer)
    assert answer.proposed.zone_tracer[-1] != answer.present.zone_tracer[-1]
    told = beside.node._forecast
    beside.node._forecast = replace(told, start=-30.0)  # of an earlier photograph
    answer = beside.ask([RateStep(0.0, flush)], 1200.0)
    assert answer.present.header == answer.proposed.header
    beside.node._forecast = told
    wrong = beside.ask([RateStep(0.0, {'absent': WellRate(1e-9)})], 600.0)
    assert "well 'absent' is not in the rig" in wrong.outcome.message

    expected = beside.judge([RateStep(0.0, flush)], plume)
    assert expected.outcome.code == Outcome.OK, expected.outcome.message
    wells = list(load_rig(RIG).wells)
    assert expected.cost > 0.0
    assert len(expected.gradient) == len(wells)
    assert expected.gradient[wells.index('control1')] < 0.0  # it pushes the plume down

    effect = EffectDescription(name='retardation', parameters={'retardation_factor': 2.0})
    beside.effects.publish(ModelEffects(effects=[conversions.effect_to_msg(effect)]))
    assert beside.effects.wait_for_all_acked()
    beside.photograph(300.0, plume)
    assert beside.states.wait_for_all_acked()  # a setpoint follows its photograph
    beside.command(300.0, control1=200.0, producer=-200.0)
    until(lambda: len(beside.forecasts) == 2)
    (step,) = beside.forecasts[1].schedule
    assert conversions.rates_from_msg(step.wells)['control1'].rate == from_ml_h(200.0)
    assert beside.node.siblings.rig.effects == (effect,)

    wrong = beside.ask([RateStep(0.001 * number, flush) for number in range(101)], 600.0)
    assert '101 changes are more than the 100' in wrong.outcome.message
    beside.photograph(2e9, plume)  # a clock that jumps: nothing is computed over half a century
    until(lambda: len(beside.forecasts) == 3)
    assert beside.node.siblings.time == 2e9

    assert beside.node._rates.is_commanded(300.0)
    beside.effects.publish(ModelEffects(sequence=1))  # a replay begins again, and so does the model
    assert beside.effects.wait_for_all_acked()
    beside.photograph(10.0, plume)
    until(lambda: len(beside.forecasts) == 4)
    assert not beside.node.siblings.rig.effects
    assert not beside.node._rates.is_commanded(300.0)

    pump = conversions.pumps_to_msg({'injector': PumpFactor(0.5, 0.01, 1.0)})
    until(lambda: beside.cycles.get_subscription_count() > 0)
    beside.cycles.publish(CycleReport(header=conversions.header_at(10.0), rate_factors=pump))
    beside.cycles.publish(CycleReport(header=conversions.header_at(11.0)))  # of a set-aside state
    until(lambda: beside.node._pumps[0] == 10.0)
    beside.photograph(40.0, plume)
    until(lambda: len(beside.forecasts) == 5)
    factors = [one.rate_factors['injector'] for one in beside.node.siblings.learning.members()]
    assert np.log(factors).mean() == pytest.approx(np.log(0.5))


def test_new_siblings_whose_making_fails_are_made_at_the_next_photograph(
    beside: Beside, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, make, made = beside.node, beside.node._make_siblings, []

    def fail_once(rig: Rig) -> Siblings:
        made.append(rig)
        if len(made) == 1:
            raise InputError('the cluster is gone')
        return make(rig)

    monkeypatch.setattr(node, '_make_siblings', fail_once)
    effect = EffectDescription(name='retardation', parameters={'retardation_factor': 2.0})
    node._new_effects = (effect,)
    until(lambda: beside.states.get_subscription_count() > 0)
    beside.photograph(0.0, np.zeros((24, 40)))
    until(lambda: len(made) == 1)
    beside.photograph(30.0, np.zeros((24, 40)))
    until(lambda: node.siblings.rig.effects == (effect,))
    beside.photograph(60.0, np.zeros((24, 40)))
    until(lambda: node.siblings.time == 60.0)
    assert len(made) == 2


def test_after_a_photograph_that_failed_the_forecasts_begin_anew(
    beside: Beside, monkeypatch: pytest.MonkeyPatch
) -> None:
    until(lambda: beside.states.get_subscription_count() > 0)
    siblings, empty = beside.node.siblings, np.zeros((24, 40))
    observe, taken = siblings.observe, []

    def observed(photograph: Photograph, periods: Sequence[RatePeriod], *pumps: Any) -> None:
        taken.append((photograph.time, len(periods)))
        if photograph.time == 100.0:
            raise InputError('a course cannot be run')
        observe(photograph, periods, *pumps)

    monkeypatch.setattr(siblings, 'observe', observed)
    for number, time_ in enumerate((0.0, 100.0, 200.0, 300.0), start=1):
        beside.photograph(time_, empty)
        until(lambda number=number: len(taken) == number)
        until(lambda: beside.node._arrived is None)
    until(lambda: bool(beside.forecasts) and beside.forecasts[-1].header.stamp.sec == 300)
    assert taken == [(0.0, 0), (100.0, 1), (200.0, 0), (300.0, 1)]

    rig = load_rig(RIG)
    assert rig.control is not None
    for end_s, ahead in ((2 * DAY_S, DAY_S), (400.0, 100.0), (300.0 + 2.4e-7, 1200.0)):
        control = rig.control.model_copy(update={'end_min': end_s / MINUTE_S})
        monkeypatch.setattr(beside.node, '_rig', rig.model_copy(update={'control': control}))
        assert beside.node._ahead() == pytest.approx(ahead), 'a day at most, and never no time'
