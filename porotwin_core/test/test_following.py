"""Tests of the one way to follow a topic whose sender matters."""

import ast
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from patience import until

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from std_msgs.msg import Header, String  # noqa: E402

from porotwin_core.basis.errors import InputError  # noqa: E402
from porotwin_core.ros import conversions, qos  # noqa: E402
from porotwin_core.ros.following import follow  # noqa: E402
from porotwin_core.ros.senders import SENDERS  # noqa: E402
from porotwin_msgs.msg import Setpoint  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]

RAW_LISTENERS = {
    'porotwin_core/porotwin_core/ros/following.py': {'?'},
    'porotwin_core/porotwin_core/ros/node.py': {'topic'},  # hands on the wish of a node
    'porotwin_hub/porotwin_hub/supervisor_node.py': {'DIAGNOSTICS', 'EVERY_NODES_TOPIC'},
    'porotwin_page/porotwin_page/page_node.py': {'DIAGNOSTICS'},
    'porotwin_recording/porotwin_recording/live/replay_audience.py': {
        'DIAGNOSTICS',
        'self._lockstep',
    },
    'porotwin_recording/porotwin_recording/recorder_node.py': {'name'},  # records whatever is said
}
"""Files with other subscriptions than `follow`, and their topics in the words of the code."""


def subscriptions() -> dict[str, set[str]]:
    """Return all topics that the product subscribes to by rclpy itself, by file."""
    found: dict[str, set[str]] = {}
    for path in ROOT.glob('porotwin_*/porotwin_*/**/*.py'):
        for call in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(call, ast.Call) and ast.unparse(call.func).endswith(
                'create_subscription'
            ):
                found.setdefault(str(path.relative_to(ROOT)), set()).add(_topic_of(call))
    return found


def _topic_of(call: ast.Call) -> str:
    return ast.unparse(call.args[1]) if len(call.args) > 1 else '?'


def followed() -> set[str]:
    """Return the topics of all calls of `follow` in the product, by their literals."""
    return {
        str(argument.value)
        for path in ROOT.glob('porotwin_*/porotwin_*/**/*.py')
        if 'ros.following import' in (text := path.read_text(encoding='utf-8'))
        for argument in ast.walk(ast.parse(text))
        if isinstance(argument, ast.Constant) and argument.value in SENDERS
    }


def test_every_topic_whose_sender_matters_is_followed_by_one_function() -> None:
    assert subscriptions() == RAW_LISTENERS
    assert followed() == {topic for topic in SENDERS if not topic.endswith('/_vouched')}


@pytest.fixture
def nodes() -> Iterator[Callable[[str], Any]]:
    """Make nodes by name, in one context."""
    context = rclpy.Context()
    rclpy.init(context=context)
    made = []

    def node(name: str) -> Any:
        made.append(rclpy.create_node(name, namespace='/porotwin', context=context))
        return made[-1]

    yield node
    for one in made:
        one.destroy_node()
    rclpy.shutdown(context=context)


class Listener:
    """A follower of `wells/setpoint`. It keeps the numbers of setpoints, and the refusals."""

    def __init__(self, node: Any) -> None:
        self.taken: list[int] = []
        self.refused: list[str] = []
        self.node = node
        follow(node, Setpoint, 'wells/setpoint', self._take, qos.FIELD, refuse=self._refuse)
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)

    def _refuse(self, topic: str, line: str) -> None:
        assert topic == 'wells/setpoint'
        self.refused.append(line)

    def _take(self, message: Setpoint) -> None:
        if message.sequence == 0:
            raise InputError('no number')
        self.taken.append(message.sequence)

    def until(self, condition: Callable[[], object]) -> None:
        """Spin until `condition` is true."""
        until(condition, lambda: self.refused, look=self.executor.spin_once)


def publish(node: Any, number: int) -> Any:
    """Publish a setpoint as `node` and return the publisher; no receiver spins meanwhile."""
    publisher = node.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
    until(publisher.get_subscription_count)
    publisher.publish(Setpoint(header=conversions.header_at(1.0), sequence=number))
    return publisher


@pytest.mark.graph
def test_no_setpoint_is_believed_while_a_stranger_could_send_it(
    nodes: Callable[[str], Any],
) -> None:
    listener, guard = Listener(nodes('siblings')), nodes('guard')
    guards = publish(guard, 1)
    listener.until(lambda: listener.taken == [1])
    guards.publish(Setpoint(sequence=0))
    listener.until(lambda: listener.refused == ['wells/setpoint ignored: no number'])
    stranger = nodes('stranger')
    forged = publish(stranger, 2)
    listener.until(lambda: len(listener.refused) == 2)
    assert '/porotwin/stranger publishes wells/setpoint too' in listener.refused[1]
    stranger.destroy_publisher(forged)
    listener.until(lambda: listener.node.count_publishers('wells/setpoint') == 1)

    def taken_again() -> bool:
        guards.publish(Setpoint(sequence=3))  # lost while the end is not noticed
        return 3 in listener.taken

    listener.until(taken_again)
    assert 2 not in listener.taken


@pytest.mark.graph
def test_no_setpoint_is_believed_of_a_stranger_that_has_left(nodes: Callable[[str], Any]) -> None:
    listener, guard, stranger = Listener(nodes('siblings')), nodes('guard'), nodes('stranger')
    guards = publish(guard, 1)
    listener.until(lambda: listener.taken == [1])
    for brief in range(1, 6):
        stranger.destroy_publisher(publish(stranger, 666))
        until(lambda: listener.node.count_publishers('wells/setpoint') == 1)
        listener.until(lambda told=brief: len(listener.refused) == told)
        assert 'published wells/setpoint too and has left' in listener.refused[-1]
        guards.publish(Setpoint(sequence=brief + 1))
        listener.until(lambda last=brief: listener.taken[-1] == last + 1)
    assert listener.taken == [1, 2, 3, 4, 5, 6]


@pytest.mark.graph
def test_a_stranger_of_another_type_hides_nobody(nodes: Callable[[str], Any]) -> None:
    listener, guard, stranger = Listener(nodes('siblings')), nodes('guard'), nodes('stranger')
    elsewhere = rclpy.Context()
    rclpy.init(context=elsewhere)  # a process publishes a topic with one type
    other = rclpy.create_node('other', namespace='/porotwin', context=elsewhere)
    for _ in range(3):
        other.create_publisher(String, 'wells/setpoint', 10)
    listener.until(lambda: listener.node.count_publishers('wells/setpoint') == 3)
    guards = publish(guard, 1)
    listener.until(lambda: listener.taken == [1])
    # a sender of the right type is noticed beside them, also when it leaves at once
    stranger.destroy_publisher(publish(stranger, 666))
    until(lambda: listener.node.count_publishers('wells/setpoint') == 4)
    listener.until(lambda: listener.refused)
    guards.publish(Setpoint(sequence=2))
    listener.until(lambda: listener.taken == [1, 2])
    assert len(listener.refused) == 1
    rclpy.shutdown(context=elsewhere)


class LateListener:
    """Follows the latched topic `asset/experiment`, and keeps the names in its messages."""

    def __init__(self, node: Any) -> None:
        self.taken: list[str] = []
        self.refused: list[str] = []
        follow(node, Header, TOPIC, self._take, qos.CONFIG, refuse=self._refuse)
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)

    def _refuse(self, topic: str, line: str) -> None:
        assert topic == TOPIC
        self.refused.append(line)

    def _take(self, message: Header) -> None:
        self.taken.append(message.frame_id)

    def until(self, condition: Callable[[], object]) -> None:
        until(condition, lambda: self.refused, look=self.executor.spin_once)

    def spin(self) -> None:
        """Spin for five looks at the publishers."""
        end = time.monotonic() + 5 * LOOK_EACH_S
        self.until(lambda: time.monotonic() > end)


TOPIC = 'asset/experiment'

LOOK_EACH_S = 0.05
"""Time between two looks at the publishers [s]; that of the nodes is longer."""


@pytest.mark.graph
def test_a_true_latched_message_is_taken_once_when_the_stranger_has_gone(
    nodes: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('porotwin_core.ros.following.POLL_S', LOOK_EACH_S)
    imaging, stranger = nodes('imaging'), nodes('stranger')
    imaging.create_publisher(Header, TOPIC, qos.CONFIG).publish(Header(frame_id='true'))
    for silent in (True, False):
        forged = stranger.create_publisher(Header, TOPIC, qos.CONFIG)
        if not silent:
            forged.publish(Header(frame_id='forged'))
        late = LateListener(nodes(f'late_{silent}'.lower()))
        late.until(lambda late=late: late.refused)
        late.spin()  # nothing is taken while the stranger stands, nor told again
        assert late.taken == [] and len(late.refused) <= 2
        stranger.destroy_publisher(forged)
        late.until(lambda late=late: late.taken)
        for _ in range(3):
            stranger.destroy_publisher(stranger.create_publisher(Header, TOPIC, qos.CONFIG))
            brief = stranger.create_publisher(Header, TOPIC, qos.CONFIG)
            brief.publish(Header(frame_id='forged'))
            late.spin()
            stranger.destroy_publisher(brief)
            late.spin()
        assert late.taken == ['true']
        assert all('asset/experiment ignored' in line for line in late.refused)
