"""The hub's and the operator's nodes without a graph: what they let out, and when."""

import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.parameter import Parameter

from porotwin_core import conversions
from porotwin_core.rig import load_rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate
from porotwin_hub import hub_node, operator_node
from porotwin_hub.control import Limits
from porotwin_hub.twin import Correction
from porotwin_msgs.msg import NewState, Setpoint, WellRates
from porotwin_msgs.srv import ConfirmRates, Control

pytestmark = pytest.mark.graph

RIG = Path(__file__).resolve().parents[1] / 'config' / 'small_rig.yaml'
LIMITS = Limits.of(load_rig(RIG))
SAFE = LIMITS.safe()
OTHER = LIMITS.setpoint(from_ml_h(1.0) * np.array([100.0, 0.0, 0.0]))


@pytest.fixture
def context() -> Iterator[rclpy.Context]:
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    rclpy.shutdown(context=context)


class Physics:
    """Stands for the solver's client: tracer in the zone is less the more is pumped."""

    def __init__(self, *_: object) -> None:
        pass

    def predict(self, concentration: Any, rates: Any, time_step: float) -> Any:
        return concentration + 0.001


class Outlet:
    """A publisher that notes what goes through it, in order with the others of its `log`."""

    def __init__(self, name: str, log: list[tuple[str, Any]]) -> None:
        self.name, self.log = name, log

    def publish(self, message: Any) -> None:
        self.log.append((self.name, message))


@pytest.fixture
def hub(
    context: rclpy.Context, monkeypatch: pytest.MonkeyPatch
) -> tuple[hub_node.HubNode, list[tuple[str, Any]]]:
    """A hub whose models answer at once, and all that it lets out."""
    log: list[tuple[str, Any]] = []

    def silent_costa(*_: object) -> Correction:
        log.append(('asked costa', None))
        return Correction(None, 'silent')

    monkeypatch.setattr(hub_node, 'PhysicsModelClient', Physics)
    monkeypatch.setattr(hub_node, 'DataDrivenModelClient', lambda *_: silent_costa)
    monkeypatch.setattr(hub_node, 'send_control', lambda call, message: None)
    overrides = [Parameter('rig', value=str(RIG)), Parameter('grid', value='20x12')]
    overrides.append(Parameter('evaluations', value=12))
    node = hub_node.HubNode(context=context, parameter_overrides=overrides)
    node._setpoint = Outlet('setpoint', log)
    node._report = Outlet('report', log)
    return node, log


def refreshed(hub: hub_node.HubNode, stamp: float) -> hub_node.Refreshed:
    tracer = conversions.tracer_to_msg(np.zeros(hub._grid.shape), hub._grid, stamp)
    state = NewState(header=conversions.header_at(stamp), tracer=tracer)
    return hub_node.Refreshed(state, hub._measured, time.time())


def names(log: list[tuple[str, Any]]) -> list[str]:
    return [name for name, _ in log]


def test_the_setpoint_leaves_before_costa_is_asked(hub: Any) -> None:
    node, log = hub
    node._cycle(refreshed(node, 30.0), 0)
    assert names(log) == ['setpoint', 'asked costa', 'report']


def test_a_photograph_from_last_week_is_reported_without_a_setpoint(hub: Any) -> None:
    node, log = hub
    old = time.time() - 7 * 86400.0
    for number in range(3):
        node._cycle(refreshed(node, old + 30.0 * number), 0)
    assert 'setpoint' not in names(log)
    remarks = [message.remarks for name, message in log if name == 'report']
    assert all(
        'no setpoint: the photograph was taken ' in one[0] and 'day' in one[0] for one in remarks
    ), remarks
    node._cycle(refreshed(node, time.time() - 3.0), 0)
    assert 'setpoint' in names(log)


def test_a_photograph_that_waited_too_long_in_the_hub_is_not_acted_on(hub: Any) -> None:
    node, log = hub
    waited = refreshed(node, 30.0)
    node._cycle(hub_node.Refreshed(waited.state, None, time.time() - 100.0), 0)
    assert names(log) == ['asked costa', 'report']


def test_rates_confirmed_before_a_setpoint_are_forgotten_with_it(hub: Any) -> None:
    node, _ = hub
    node._measured = SAFE
    node._cycle(refreshed(node, 30.0), 0)
    assert node._measured is None


@pytest.fixture
def operator(context: rclpy.Context) -> operator_node.OperatorNode:
    overrides = [Parameter('rig', value=str(RIG)), Parameter('asset', value=True)]
    node = operator_node.OperatorNode(context=context, parameter_overrides=overrides)
    node.moment = 1000.0
    node._now = lambda: node.moment
    return node


def setpoint(sequence: int, rates: dict[str, WellRate], *, validity: float = 90.0) -> Setpoint:
    return Setpoint(
        header=conversions.header_at(5.0),
        sequence=sequence,
        valid_until=conversions.time_to_msg(5.0 + validity),
        wells=conversions.rates_to_msg(rates),
    )


def said(operator: Any, capsys: pytest.CaptureFixture[str], message: Setpoint) -> str:
    operator._on_setpoint(message)
    return capsys.readouterr().out


def test_after_a_hub_restart_changes_are_told_from_what_was_told_last(
    operator: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    for sequence, rates in ((1, OTHER), (2, OTHER), (3, SAFE)):
        said(operator, capsys, setpoint(sequence, rates))
    assert '<-- was' not in said(operator, capsys, setpoint(1, SAFE))
    assert '<-- was 0.0' in said(operator, capsys, setpoint(2, OTHER))
    assert '<-- was' not in said(operator, capsys, setpoint(3, OTHER))
    assert list(operator._asked) == [1, 2, 3]


@pytest.mark.parametrize(
    'wrong',
    [
        {**SAFE, 'control1': WellRate(from_ml_h(9e5))},
        {**SAFE, 'injector': WellRate(from_ml_h(500.0), 0.0)},
        {**SAFE, 'nowhere': WellRate(1e-9)},
    ],
)
def test_a_setpoint_that_breaks_a_limit_is_not_announced(
    wrong: dict[str, WellRate], operator: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said(operator, capsys, setpoint(1, wrong)) == ''
    assert operator._asked == {}
    answer = operator._on_control(Control.Request(setpoint=setpoint(1, wrong)), Control.Response())
    assert answer.outcome.message


def test_a_setpoint_that_was_never_valid_is_not_announced(
    operator: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said(operator, capsys, setpoint(1, SAFE, validity=-1.0)) == ''


def test_a_setpoint_that_expires_without_a_successor_is_said_once(
    operator: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    said(operator, capsys, setpoint(1, OTHER))
    operator.moment += 89.0
    operator._on_timer()
    assert capsys.readouterr().out == ''
    operator.moment += 2.0
    operator._on_timer()
    operator._on_timer()
    told = capsys.readouterr().out
    assert told.count('setpoint 1 has expired') == 1
    assert '0.0 ml/h   <-- was 100.0' in told
    assert '<-- was 0.0' in said(operator, capsys, setpoint(2, OTHER))


def test_what_the_operator_confirms_carries_the_time_of_the_photographs(operator: Any) -> None:
    sent: list[WellRates] = []
    operator._measured = SimpleNamespace(publish=sent.append)
    operator._on_setpoint(setpoint(1, OTHER))  # its photograph: at 5 s
    operator.moment += 12.0
    answer = operator._on_confirm(ConfirmRates.Request(sequence=1), ConfirmRates.Response())
    assert answer.outcome.message == ''
    assert conversions.time_from_msg(sent[0].start) == pytest.approx(17.0)
    assert sent[0].header.stamp == sent[0].start


def test_an_expired_setpoint_is_confirmed_as_the_safe_rates_that_were_asked_for_then(
    operator: Any,
) -> None:
    operator._on_setpoint(setpoint(1, OTHER))
    operator.moment += 91.0
    operator._on_timer()
    assert operator._confirmed(ConfirmRates.Request(sequence=1)) == operator._limits.safe()


def test_the_clock_of_expiry_is_one_that_nobody_sets(context: rclpy.Context) -> None:
    overrides = [Parameter('rig', value=str(RIG))]
    node = operator_node.OperatorNode(context=context, parameter_overrides=overrides)
    assert node._now() == pytest.approx(time.monotonic(), abs=5.0)
