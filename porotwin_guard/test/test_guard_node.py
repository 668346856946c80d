"""Tests of the guard's node: one hub, one guard, and setpoints that reach the pumps."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from patience import until
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node_thread import NodeThread
from porotwin_core.ros.vouching import Voucher
from porotwin_guard.guard_node import GuardNode
from porotwin_msgs.msg import Outcome, Setpoint
from porotwin_msgs.srv import Control

pytestmark = pytest.mark.graph

SMALL_RIG = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'


class Loop:
    """A guard between a hub and pumps that this test plays."""

    def __init__(self, context: rclpy.Context, *, simulated: bool = False) -> None:
        self._context = context
        overrides = [
            Parameter('rig', value=str(SMALL_RIG)),
            Parameter('asset_timeout_s', value=120.0),  # longer than a test waits
            Parameter('use_sim_time', value=simulated),
        ]
        self.guard = GuardNode(context=context, parameter_overrides=overrides)
        self._thread = NodeThread(self.guard, threads=4)
        self.pumps = self.node('operator')
        self.hub = self.node('hub')
        self.control = self.hub.create_client(Control, 'guard/control')
        self.voucher = Voucher(self.hub)
        self.published: list[int] = []
        self.pumped: list[int] = []
        self.pumps.create_subscription(
            Setpoint, 'wells/setpoint', lambda m: self.published.append(m.sequence), qos.SETPOINT
        )
        until(self.control.service_is_ready)
        until(lambda: self.guard.count_subscribers('wells/setpoint') > 0)

    def node(self, name: str) -> Node:
        node = rclpy.create_node(name, context=self._context)
        self._thread.executor.add_node(node)
        return node

    def close(self) -> None:
        self._thread.end()

    def attach_pumps(self) -> None:
        self.pumps.create_service(Control, 'asset/control', self._on_control)
        until(lambda: 'asset/control' in str(self.guard.get_service_names_and_types()))

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        self.pumped.append(request.setpoint.sequence)
        response.outcome = conversions.ok()
        return response

    def send(
        self, sequence: int, control1_ml_h: float = 100.0, taken: float | None = None
    ) -> Outcome:
        taken = time.time() - 1.0 if taken is None else taken
        rates = {
            'injector': WellRate(from_ml_h(500.0), 1.0),
            'producer': WellRate(-from_ml_h(500.0 + control1_ml_h)),
            'control1': WellRate(from_ml_h(control1_ml_h)),
            'control2': WellRate(),
            'control3': WellRate(),
        }
        setpoint = Setpoint(
            header=conversions.header_at(taken),
            sequence=sequence,
            valid_until=conversions.time_to_msg(taken + 90.0),
            wells=conversions.rates_to_msg(rates),
        )
        request = Control.Request(setpoint=setpoint)
        self.voucher.vouch('guard/control', request)
        future = self.control.call_async(request)
        until(future.done)
        return future.result().outcome


@pytest.fixture
def loop(domain: int) -> Iterator[Loop]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    made = Loop(context)
    yield made
    made.close()


def test_only_valid_setpoints_of_the_only_hub_reach_the_pumps(loop: Loop) -> None:
    assert 'no node answers asset/control' in loop.send(1).message
    loop.attach_pumps()
    assert loop.send(2).code == Outcome.OK
    refused = loop.send(3, control1_ml_h=900.0)
    assert refused.code == Outcome.INVALID_INPUT
    assert "well 'control1': 900 ml/h" in refused.message
    stranger = loop.node('stranger')
    client = stranger.create_client(Control, 'guard/control')
    until(client.service_is_ready)
    assert '/stranger calls guard/control too' in loop.send(4).message
    stranger.destroy_client(client)
    until(lambda: loop.send(5 + time.monotonic_ns()).code == Outcome.OK)
    publisher = stranger.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
    until(lambda: loop.guard.count_publishers('wells/setpoint') == 2)
    refused = loop.send(6 + time.monotonic_ns())
    assert '/stranger publishes wells/setpoint too' in refused.message
    stranger.destroy_publisher(publisher)
    until(lambda: loop.guard.count_publishers('wells/setpoint') == 1)
    loop.node('hub').create_client(Control, 'guard/control')
    until(lambda: '2 nodes /hub' in loop.send(7 + time.monotonic_ns()).message)
    until(lambda: loop.pumped == loop.published)  # only what the pumps took


def test_no_setpoint_counts_as_pumped_while_a_foreign_node_answers_for_the_pumps(
    loop: Loop,
) -> None:
    loop.attach_pumps()
    rogue = loop.node('rogue')

    def believe(_: Control.Request, response: Control.Response) -> Control.Response:
        response.outcome = conversions.ok()
        return response

    service = rogue.create_service(Control, 'asset/control', believe)
    refused = loop.send(1)
    assert refused.code == Outcome.FAILED
    assert '/rogue offers asset/control too, and only' in refused.message
    assert loop.pumped == loop.published == []
    rogue.destroy_service(service)
    assert loop.send(2).code == Outcome.OK


def test_the_clock_of_a_running_guard_cannot_be_changed(loop: Loop) -> None:
    loop.attach_pumps()
    (refused,) = loop.guard.set_parameters([Parameter('use_sim_time', value=True)])
    assert not refused.successful
    clock = loop.node('stranger').create_publisher(Clock, '/clock', qos.CLOCK)
    clock.publish(Clock(clock=conversions.time_to_msg(8e8)))
    old = loop.send(1, taken=8e8)  # in 1995
    assert 'it expired' in old.message
    assert loop.pumped == []
    assert loop.send(2).code == Outcome.OK


@pytest.fixture
def simulated(domain: int) -> Iterator[Loop]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    made = Loop(context, simulated=True)
    made.attach_pumps()
    yield made
    made.close()


def test_in_simulated_time_a_guard_without_a_clock_passes_nothing(simulated: Loop) -> None:
    assert 'nobody publishes /clock' in simulated.send(1, taken=8e8).message
    clock = simulated.node('virtual_rig').create_publisher(Clock, '/clock', qos.CLOCK)
    until(lambda: clock.get_subscription_count() > 0)
    clock.publish(Clock(clock=conversions.time_to_msg(0.0)))
    until(lambda: simulated.guard._simulated_time is not None)
    assert 'in the future' in simulated.send(2, taken=8e8).message
    assert simulated.send(3, taken=0.0).code == Outcome.OK


def test_in_simulated_time_a_guard_takes_no_foreign_clock(simulated: Loop) -> None:
    clock = simulated.node('stranger').create_publisher(Clock, '/clock', qos.CLOCK)
    until(lambda: clock.get_subscription_count() > 0)
    clock.publish(Clock(clock=conversions.time_to_msg(8e8)))
    assert clock.wait_for_all_acked()
    assert '/stranger publishes /clock too' in simulated.send(1, taken=8e8).message
    assert simulated.guard._simulated_time is None
    assert simulated.pumped == []
