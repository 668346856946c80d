"""Tests of the hub without ROS: setpoints leave first, and late photographs lead to none."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hub_examples import ToyModel

from porotwin_core.clock.freshness import IN_TIME, PhotographClock
from porotwin_core.model.correction import Correction
from porotwin_core.rates.rate_periods import KnownRates
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.hub import Hub
from porotwin_hub.loop.inbox import ArrivedState, ReadyState
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import ModelUnavailable
from porotwin_hub.operator.setpoint_expiry import SetpointDecision

SHAPE = (10, 20)
NOW = 1.8e9
"""The time of these tests [s] since 1970."""


class Desk:
    """A hub with everything that it sends and asks, in order."""

    def __init__(self, model: ToyModel, controller: Controller, *, simulated: bool) -> None:
        self.log: list[str] = []
        self.setpoints: list[SetpointDecision] = []
        self.asset_answers = True
        twin = Twin(model, self._no_sigma, photo_interval=30.0, controller=controller)
        self.photographs = PhotographClock(interval=30.0, validity=twin.validity)
        self.simulated = simulated
        most_age = math.inf if simulated else self.photographs.most_age
        self.hub = Hub(twin, limits=controller.limits, clock=lambda: NOW, most_age=most_age)

    def _no_sigma(self, *_: object) -> Correction:
        self.log.append('costa')
        return Correction(None, 'silent')

    def actuate(self, setpoint: SetpointDecision, ready: ReadyState[Any]) -> None:
        self.log.append('setpoint')
        self.setpoints.append(setpoint)
        if not self.asset_answers:
            raise ModelUnavailable('setpoint 1 not taken: the asset is absent')

    def run(self, stamp: float, *, arrival: float = NOW, objection: str = '', **more: Any) -> Any:
        state = ArrivedState(1, stamp, np.zeros(SHAPE), None)
        judgement = IN_TIME if self.simulated else self.photographs.judge(stamp, arrival)
        ready = ReadyState(state, arrival, judgement, **more)
        return self.hub.run(ready, self.actuate, objection=objection)


@pytest.fixture
def make_desk(toy_model: ToyModel, toy_controller: Controller) -> Callable[[bool], Desk]:
    return lambda simulated: Desk(toy_model, toy_controller, simulated=simulated)


@pytest.fixture
def desk(make_desk: Callable[[bool], Desk]) -> Desk:
    return make_desk(False)


def test_the_setpoint_is_sent_before_costa_is_asked(desk: Desk) -> None:
    cycle = desk.run(NOW - 2.0)
    assert desk.log == ['setpoint', 'costa']
    assert cycle.forecast is not None
    assert cycle.remarks == []


def test_a_photograph_from_last_week_leads_to_no_setpoint(desk: Desk) -> None:
    old = NOW - 7 * 86400.0
    for number in range(3):
        (remark,) = desk.run(old + 30.0 * number).remarks
        assert remark.startswith('no setpoint: the photograph was taken ')
        assert 'day' in remark
    assert desk.setpoints == []
    desk.run(NOW - 3.0)
    assert len(desk.setpoints) == 1


def test_a_photograph_that_waited_too_long_is_not_acted_on(
    toy_model: ToyModel, toy_controller: Controller
) -> None:
    desk = Desk(toy_model, toy_controller, simulated=False)
    desk.run(NOW - 102.0, arrival=NOW - 100.0)
    assert desk.log == ['costa']


def test_in_simulated_time_no_photograph_is_late(make_desk: Callable[[bool], Desk]) -> None:
    desk = make_desk(True)
    desk.run(NOW - 7 * 86400.0)
    assert desk.log == ['setpoint', 'costa']


def test_a_setpoint_that_the_asset_does_not_take_is_a_remark(
    desk: Desk, toy_limits: Limits
) -> None:
    desk.asset_answers = False
    cycle = desk.run(NOW - 2.0)
    assert cycle.remarks == ['setpoint 1 not taken: the asset is absent']
    assert cycle.forecast.rates == toy_limits.safe()


def test_other_rates_in_force_are_predicted_before_the_setpoint(
    desk: Desk, toy_limits: Limits
) -> None:
    desk.run(NOW - 32.0)
    desk.log.clear()
    known = (KnownRates(NOW - 32.0, NOW - 2.0, toy_limits.safe()),)
    cycle = desk.run(NOW - 2.0, known=known)
    assert desk.log == ['costa', 'setpoint', 'costa']
    assert len(cycle.notes) == 1


def test_after_an_interruption_nothing_is_judged(desk: Desk) -> None:
    desk.run(NOW - 62.0)
    assert desk.run(NOW - 32.0).elapsed is not None
    assert desk.run(NOW - 2.0, interruptions=('photographs were missed',)).elapsed is None


def test_skipped_states_are_a_remark(desk: Desk) -> None:
    cycle = desk.run(NOW - 2.0, skipped=2)
    assert cycle.remarks == ['2 older states skipped: cycles are slower than photos']


def test_after_time_went_back_the_loop_begins_anew(
    make_desk: Callable[[bool], Desk], toy_model: ToyModel
) -> None:
    desk = make_desk(True)
    desk.run(NOW - 2.0)
    toy_model.available = False
    desk.run(NOW - 32.0, time_went_back=True)
    assert desk.setpoints[-1].reason.startswith('safe rates')


@pytest.mark.parametrize('stamp', [0.0, 5.0, 1e9, 2.145e9])
def test_a_wrong_stamp_leads_to_one_remark_and_spoils_nothing(
    desk: Desk, toy_model: ToyModel, stamp: float
) -> None:
    desk.run(NOW - 42.0, arrival=NOW - 40.0)
    toy_model.steps.clear()
    cycle = desk.run(stamp, doubts=('the doubt',))
    assert (cycle.remarks, cycle.setpoint, cycle.forecast) == (['the doubt'], None, None)
    assert toy_model.steps == []
    cycle = desk.run(NOW - 12.0)
    assert (len(desk.setpoints), cycle.remarks) == (2, [])
    assert cycle.elapsed is not None
    assert max(toy_model.steps) <= 600.0


def test_an_objection_is_a_remark_instead_of_a_setpoint(desk: Desk) -> None:
    cycle = desk.run(NOW - 2.0, objection='two hubs run')
    assert cycle.remarks == ['no setpoint: two hubs run']
    assert cycle.forecast is not None
    assert desk.setpoints == []


@pytest.mark.parametrize('simulated', [True, False])
def test_nothing_is_predicted_over_a_long_gap(
    make_desk: Callable[[bool], Desk], toy_model: ToyModel, simulated: bool
) -> None:
    desk = make_desk(simulated)
    desk.run(NOW - 1e7, arrival=NOW - 1e7)
    toy_model.steps.clear()
    cycle = desk.run(NOW - 2.0)
    assert cycle.elapsed is None
    assert cycle.notes == ['interrupted: 9999998 s without a photograph; none is predicted']
    assert max(toy_model.steps) <= 600.0
    assert desk.run(NOW + 28.0, arrival=NOW + 30.0).elapsed is not None
