"""Tests of the main loop of nodes: its health, its parameters, and a quiet end at any moment."""

import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest
from patience import PATIENCE_S, until

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.node import (
    DIAGNOSTICS,
    HEARTBEAT_S,
    LEFT_OUT,
    Diagnostics,
    TwinNode,
    declare,
    run,
)
from porotwin_core.ros.node_thread import NodeThread

pytestmark = pytest.mark.graph


class ShutDownBetween(Node):
    """A node whose context is shut down between the executor's check and its wait."""

    def __init__(self) -> None:
        super().__init__('shut_down_between')

    @property
    def timers(self) -> Iterator[Timer]:
        rclpy.try_shutdown(context=self.context)
        yield from super().timers


def broken_node() -> Node:
    raise RCLError('no such luck')


def node_shut_down_while_made() -> Node:
    rclpy.try_shutdown()
    return Node('late')


@pytest.fixture(autouse=True)
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, 'argv', ['node'])


@pytest.mark.parametrize('threads', [1, 2])
def test_a_shutdown_between_two_checks_of_the_executor_is_no_failure(threads: int) -> None:
    run(ShutDownBetween, threads=threads)


def test_a_shutdown_while_the_node_is_made_is_no_failure() -> None:
    run(node_shut_down_while_made)


def test_a_failure_of_the_middleware_is_raised() -> None:
    with pytest.raises(RCLError, match='no such luck'):
        run(broken_node)


def test_a_mistake_in_the_parameters_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    complaint = "parameter 'rate' of pump: below 0; name a rate from 0"

    def wrong_node() -> Node:
        raise InputError(complaint)

    with pytest.raises(SystemExit) as ended:
        run(wrong_node)
    assert ended.value.code == 2
    assert capfd.readouterr().err == f'error: {complaint}\n'


@pytest.fixture
def node_of_ranges() -> Iterator[Node]:
    context = rclpy.Context()
    rclpy.init(context=context)
    made = Node(
        'ranges',
        context=context,
        parameter_overrides=[
            Parameter('horizon_s', value=-5.0),
            Parameter('interval_s', value=math.nan),
            Parameter('preset', value='quick'),
        ],
    )
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


def test_a_parameter_out_of_its_range_is_refused_with_the_range(node_of_ranges: Node) -> None:
    with pytest.raises(InputError, match=r"'horizon_s' of ranges is -5; .*at least 1"):
        declare(node_of_ranges, 'horizon_s', 600.0, 'look-ahead [s]', at_least=1.0)
    with pytest.raises(InputError, match=r"'interval_s' of ranges is nan; .*from 1 to 3600"):
        declare(node_of_ranges, 'interval_s', 3.0, 'interval [s]', at_least=1.0, at_most=3600.0)
    with pytest.raises(InputError, match=r"'preset' of ranges is 'quick'.*one of: fast, upwind"):
        declare(node_of_ranges, 'preset', 'fast', 'scheme', choices=('fast', 'upwind'))


def test_a_change_is_checked_and_taken(node_of_ranges: Node) -> None:
    taken: list[int] = []
    declare(node_of_ranges, 'count', 3, 'a number', at_least=1, at_most=9, on_change=taken.append)
    assert node_of_ranges.set_parameters([Parameter('count', value=5)])[0].successful
    refused = node_of_ranges.set_parameters([Parameter('count', value=10)])[0]
    assert not refused.successful
    assert 'Min: 1, Max: 9, value: 10' in refused.reason
    assert taken == [5]
    assert node_of_ranges.get_parameter('count').value == 5


def test_programs_read_the_range_of_a_parameter(node_of_ranges: Node) -> None:
    declare(node_of_ranges, 'count', 3, 'a number', at_least=1)
    declare(node_of_ranges, 'share', 0.5, 'a share [-]', at_least=0.0, at_most=1.0)
    declare(node_of_ranges, 'any', 0.5, 'any number')
    count, share, free = map(node_of_ranges.describe_parameter, ('count', 'share', 'any'))
    (whole,), (between,) = count.integer_range, share.floating_point_range
    assert (whole.from_value, whole.to_value, whole.step) == (1, 2**63 - 1, 0)
    assert (between.from_value, between.to_value, between.step) == (0.0, 1.0, 0.0)
    assert not free.floating_point_range
    assert count.read_only
    assert count.description == 'a number'


@pytest.mark.parametrize('second', [10, 7])
def test_several_changes_are_taken_together_or_not_at_all(
    node_of_ranges: Node, second: int
) -> None:
    in_use = {}

    def take(name: str, value: int) -> None:
        if value == 7:
            raise InputError('7 brings bad luck')
        in_use[name] = value

    for name in ('first', 'second'):
        declare(
            *(node_of_ranges, name, 3, 'a number'),
            at_least=1,
            at_most=9,
            on_change=partial(take, name),
        )
    wanted = [Parameter('first', value=5), Parameter('second', value=second)]
    assert not node_of_ranges.set_parameters_atomically(wanted).successful
    assert in_use.get('first', 3) == node_of_ranges.get_parameter('first').value == 3
    wanted[1] = Parameter('second', value=6)
    assert node_of_ranges.set_parameters_atomically(wanted).successful
    assert in_use == {'first': 5, 'second': 6}


@pytest.fixture
def twin_node() -> Iterator[TwinNode]:
    context = rclpy.Context()
    rclpy.init(context=context)
    made = TwinNode('twin', context=context)
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


def test_nobody_gives_a_running_node_another_clock(twin_node: TwinNode) -> None:
    (refused,) = twin_node.set_parameters([Parameter('use_sim_time', value=True)])
    assert not refused.successful
    assert 'use_sim_time' in refused.reason
    assert not twin_node.simulated
    assert not twin_node.get_clock().ros_time_is_active
    (same,) = twin_node.set_parameters([Parameter('use_sim_time', value=False)])
    assert same.successful


def test_the_log_of_a_node_is_plain(twin_node: TwinNode, capfd: pytest.CaptureFixture[str]) -> None:
    for _ in range(3):
        twin_node.get_logger().error('ignored: \x1b[2J\rsetpoint 777\n  <-- set')
        twin_node.get_logger().warning('seldom', throttle_duration_sec=60.0)
    captured = capfd.readouterr()
    lines = (captured.out + captured.err).splitlines()
    assert sum('\\x1b[2J\\rsetpoint 777\\n  <-- set' in line for line in lines) == 3
    assert sum('seldom' in line for line in lines) == 1
    assert len(lines) == 4
    assert all(line.isprintable() for line in lines)


def test_a_node_prints_every_letter_on_every_terminal() -> None:
    source = """
from porotwin_core.ros.node import run
def refuse():
    print('setpoint of br\u00f8nn')
    raise KeyboardInterrupt
run(refuse)
"""
    environment = os.environ | {'PYTHONIOENCODING': 'ascii'}
    done = subprocess.run(
        [sys.executable, '-c', source], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == 'setpoint of br\\xf8nn\n'


def ask(node: TwinNode, kind: Any, name: str, request: Any) -> Any:
    """Return the answer of a service of `node` itself, whose executor runs meanwhile."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    future = node.create_client(kind, name).call_async(request)
    executor.spin_until_future_complete(future, PATIENCE_S)
    return future.result()


def test_a_parameter_of_a_type_that_does_not_exist_does_not_end_the_node(
    twin_node: TwinNode, capfd: pytest.CaptureFixture[str]
) -> None:
    wrong = ParameterMessage(name='any', value=ParameterValue(type=86))
    for kind, name in (
        (SetParameters, 'twin/set_parameters'),
        (SetParametersAtomically, 'twin/set_parameters_atomically'),
    ):
        assert ask(twin_node, kind, name, kind.Request(parameters=[wrong])) == kind.Response()
    assert '86' in capfd.readouterr().err


def test_messages_and_requests_that_a_callback_cannot_take_are_left_out(
    twin_node: TwinNode, capfd: pytest.CaptureFixture[str]
) -> None:
    heard = list[str]()

    def hear(message: String) -> None:
        heard.append(message.data)
        if message.data == 'poison':
            raise KeyError('antidote')

    def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        raise ZeroDivisionError

    twin_node.create_subscription(String, 'words', hear, 10)
    twin_node.create_service(Trigger, 'serve', serve)
    publisher = twin_node.create_publisher(String, 'words', 10)
    for word in ('poison', 'bread'):
        publisher.publish(String(data=word))
    answer = ask(twin_node, Trigger, 'serve', Trigger.Request())
    while 'bread' not in heard:
        answer = ask(twin_node, Trigger, 'serve', Trigger.Request())
    assert heard == ['poison', 'bread']
    assert answer == Trigger.Response()
    log = capfd.readouterr().err
    assert f'words: {LEFT_OUT}' in log
    assert f'serve: {LEFT_OUT}' in log
    assert 'antidote' in log


def test_a_negative_simulated_time_is_refused_in_plain_words(
    domain: int, capfd: pytest.CaptureFixture[str]
) -> None:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = TwinNode(
        'twin', context=context, parameter_overrides=[Parameter('use_sim_time', value=True)]
    )
    other = rclpy.create_node('virtual_rig', context=context)
    thread = NodeThread(node, other)
    publisher = other.create_publisher(Clock, '/clock', 10)
    for seconds in (-5, 7):
        shown: list[str] = []

        def told(seconds: int = seconds, shown: list[str] = shown) -> bool:
            publisher.publish(Clock(clock=Time(sec=seconds)))
            shown.append(capfd.readouterr().err)
            return f'time {seconds} s' in ''.join(shown) or node.now() == seconds

        until(told, shown)
        assert LEFT_OUT not in ''.join(shown)
    thread.end()


class Watched(Node):
    """A node that hears its own health, and ends when `enough` reports say so."""

    def __init__(self) -> None:
        super().__init__('watched')
        self.heard: list[DiagnosticStatus] = []
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._hear, 10)

    def _hear(self, message: DiagnosticArray) -> None:
        self.heard += message.status
        if self.enough():
            rclpy.try_shutdown(context=self.context)

    def enough(self) -> bool:
        return len(self.heard) >= 2


def test_every_node_tells_its_health_without_code_of_its_own() -> None:
    nodes: list[Watched] = []

    def make() -> Watched:
        nodes.append(Watched())
        return nodes[0]

    run(make, threads=1)
    names = {
        (status.name, status.hardware_id, status.level, status.message) for status in nodes[0].heard
    }
    assert names == {('watched', 'porotwin', DiagnosticStatus.OK, 'running')}  # as in REP-107


class Stuck(Watched):
    """A node whose worker hangs, and whose callback blocks all others but the heartbeat."""

    def __init__(self) -> None:
        super().__init__()
        self.ended = threading.Event()
        self.diagnostics = Diagnostics(self)
        self.diagnostics.report(DiagnosticStatus.OK, 'state 3 done')
        self.work = self.diagnostics.busy('state 4', longest_s=0.5)
        self.work.__enter__()
        self.subscription = self.create_subscription(
            DiagnosticArray,
            DIAGNOSTICS,
            self._hear,
            10,
            callback_group=rclpy.callback_groups.ReentrantCallbackGroup(),
        )
        self.create_timer(0.1, lambda: self.ended.wait(60.0))

    def enough(self) -> bool:
        if any('state 4: at work' in status.message for status in self.heard):
            self.ended.set()
            return True
        return False


def test_a_stuck_worker_shows_while_the_executor_spins_on() -> None:
    nodes: list[Stuck] = []

    def make() -> Stuck:
        nodes.append(Stuck())
        return nodes[0]

    run(make)
    stuck = nodes[0].heard[-1]
    assert stuck.level == DiagnosticStatus.ERROR
    assert {value.key for value in stuck.values} >= {'report_age_s', 'busy_with', 'busy_s'}


class Destroyed:
    """Asks the process to stop while Python destroys it, where errors are dropped."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


class AskedInADestructor(Node):
    """A node that is asked to stop inside a destructor."""

    def __init__(self) -> None:
        super().__init__('asked_in_a_destructor')
        self.create_timer(0.1, self._destroy)
        self._times = 0

    def _destroy(self) -> None:
        self._times += 1
        if self._times == 1:
            Destroyed()


@pytest.mark.filterwarnings('ignore::pytest.PytestUnraisableExceptionWarning')
def test_an_interrupt_that_python_drops_is_repeated() -> None:
    run(AskedInADestructor, threads=1)


def test_a_node_that_others_have_forgotten_ends_to_be_started_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr('porotwin_core.ros.node.LEASE_S', HEARTBEAT_S / 2)  # as if it had slept
    with pytest.raises(SystemExit, match='stood still for 1 s, so that the other nodes'):
        run(lambda: Node('sleeper'), threads=1)
