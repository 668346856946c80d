"""Plays a bag into a graph, with /clock, as if it happened now."""

import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from porotwin_core.errors import InputError
from porotwin_core.node import declare, run
from porotwin_recording import topics
from porotwin_recording.bag_reader import BagMessage, BagReader
from porotwin_recording.definitions import message_definition, type_hash
from porotwin_recording.interfaces import message_class
from porotwin_recording.player import (
    CLOCK,
    LATCHED_LIMIT,
    Pace,
    as_measured,
    latched_before,
    played_topics,
)
from porotwin_recording.serialization import SECOND, Serializer, stamp_of
from porotwin_recording.topic import Topic

QUEUE_DEPTH = 1000
QUEUE_SIZE = 64 << 20
"""Messages of one topic, and their bytes, after which the player waits for its subscribers."""

ACKNOWLEDGE_TIMEOUT = 10.0
"""Longest wait for a subscriber [s]; Fast DDS asks every 3 s what has arrived."""

CLOCK_PERIOD = 0.05
"""How often /clock goes on between two messages [s of wall time]."""

_DRIVING = (f'/{topics.IMAGE}', f'/{topics.STATE_REFRESHED}')
"""Topics whose messages the graph answers with a cycle each."""


def _depth(topic: Topic) -> int:
    return LATCHED_LIMIT if topic.qos.latched else QUEUE_DEPTH


def _publisher_qos(topic: Topic) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=_depth(topic),
        reliability=ReliabilityPolicy[topic.qos.reliability.upper()],
        durability=DurabilityPolicy[topic.qos.durability.upper()],
    )


def _installed_class(topic: Topic) -> type[Any]:
    """Return the class of a recorded topic, whose type must be the same here as in the bag."""
    kind = message_class(topic.type_name)
    installed = message_definition(topic.type_name)
    if topic.definition and type_hash(topic.type_name, topic.definition) != type_hash(
        topic.type_name, installed
    ):
        raise InputError(f"'{topic.type_name}' was recorded in another version than is installed")
    return kind


class PlayerNode(Node):
    """Publishes the messages of a bag, byte for byte, at the pace of their log times.

    The process ends with the bag, unless it is told to loop. With `lockstep`, the topic of an
    answer whose message begins with a header, a photograph (or refreshed state) is followed by
    nothing until an answer with its stamp or a later one is there: the graph sees them all, no
    matter how slow it is.
    """

    failed = False

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('player', enable_rosout=False, **kwargs)
        self._bag = BagReader(declare(self, 'bag', '', 'bag to play: folder or .mcap file'))
        wanted = declare(self, 'topics', 'inputs', "names, or 'inputs' of the twin, or 'all'")
        rate = declare(self, 'rate', 1.0, 'times as fast as recorded; 0: as fast as possible')
        start_s = declare(self, 'start_s', 0.0, 'where in the bag to start [s]')
        self._loop = declare(self, 'loop', False, 'begin again at the end')
        self._discovery = declare(self, 'discovery_s', 3.0, 'longest wait for subscribers [s]')
        lockstep = declare(self, 'lockstep', '', 'topic whose message the next photograph awaits')
        self._patience = declare(self, 'lockstep_timeout_s', 60.0, 'longest wait for it [s]')
        self._pace = Pace(rate)
        self._start = self._bag.start_time + round(start_s * SECOND)
        if self._start > self._bag.end_time:
            length = (self._bag.end_time - self._bag.start_time) / SECOND
            raise InputError(f'{self._bag.path}: lasts {length:g} s; start before its end')
        self._serializer = Serializer()
        self._clock_publisher = self.create_publisher(Clock, CLOCK, QUEUE_DEPTH)
        self._targets: dict[str, Publisher] = {}
        for name in played_topics(self._bag, wanted):
            self._add(name, told_as_measured=wanted == 'inputs')
        if not self._targets:
            raise InputError(
                f'{self._bag.path}: none of the chosen topics can be played, for their interfaces '
                'are not installed as they were recorded; choose others'
            )
        self._answered = -1
        self._answers = threading.Condition()
        self._lockstep = self.resolve_topic_name(lockstep) if lockstep else ''
        self._stopping = threading.Event()
        self._unacknowledged: dict[str, tuple[int, int]] = {}
        self._thread = threading.Thread(target=self._run, name='player')
        self._thread.start()

    def _add(self, name: str, *, told_as_measured: bool) -> None:
        """Make the publisher of a recorded topic, or say why there is none."""
        topic = self._bag.topics[name]
        qos = _publisher_qos(topic)
        if told_as_measured and name.endswith(f'/{topics.SETPOINT}'):
            kind = message_class('porotwin_msgs/msg/WellRates')
            measured = name.removesuffix(topics.SETPOINT) + topics.MEASURED
            self._targets[name] = self.create_publisher(kind, measured, qos)
            return
        try:
            self._targets[name] = self.create_publisher(_installed_class(topic), name, qos)
        except InputError as error:
            self.get_logger().warning(f'{name} is not played: {error}')

    def _run(self) -> None:
        try:
            self._listen()
            self._await_subscribers()
            self.get_logger().info(f'playing {len(self._targets)} topics of {self._bag.path}')
            while not self._stopping.is_set():
                self._play_once()
                if not self._loop:
                    break
        except InputError as error:
            self.failed = True
            self.get_logger().error(str(error))
        except Exception as error:
            # told to end, the context goes while this thread still publishes
            if self.context.ok():
                self.failed = True
                self.get_logger().fatal(f'playing failed: {error!r}')
        finally:
            if not self._stopping.is_set():
                rclpy.try_shutdown(context=self.context)

    def _listen(self) -> None:
        """Subscribe to the answers of the lock-step, whose type the running graph knows."""
        if not self._lockstep:
            return
        deadline = time.monotonic() + self._discovery
        while time.monotonic() < deadline and not self._stopping.wait(0.1):
            for name, types in self.get_topic_names_and_types():
                if name == self._lockstep and self.count_publishers(name):
                    self.create_subscription(
                        message_class(types[0]), name, self._on_answer, QUEUE_DEPTH, raw=True
                    )
                    return
        self.get_logger().warning(f'nobody publishes {self._lockstep}; playing without lock-step')
        self._lockstep = ''

    def _on_answer(self, data: bytes) -> None:
        with self._answers:
            self._answered = max(self._answered, stamp_of(data))
            self._answers.notify_all()

    def _await_subscribers(self) -> None:
        """Wait until every played topic has a subscriber, no longer than `discovery_s`."""
        deadline = time.monotonic() + self._discovery
        while time.monotonic() < deadline and not self._stopping.wait(0.05):
            if all(target.get_subscription_count() for target in self._targets.values()):
                return

    def _play_once(self) -> None:
        names = list(self._targets)
        self._pace.begin(self._start)
        self._publish_clock(self._start)
        count = 0
        for message in latched_before(self._bag, names, self._start):
            self._publish(message)
            count += 1
        self._answered = -1
        for message in self._bag.messages(names, start=self._start):
            self._wait_until(message.log_time)
            if self._stopping.is_set():
                return
            self._publish_clock(message.log_time)
            self._publish(message)
            count += 1
            if self._lockstep and message.topic.endswith(_DRIVING):
                self._await_answer(message)
        self._acknowledge()
        self.get_logger().info(f'{self._bag.path}: {count} messages played')

    def _wait_until(self, log_time: int) -> None:
        """Let the clock run until `log_time` [ns] is due."""
        while (wait := self._pace.wait_for(log_time)) > 0:
            if self._stopping.wait(min(wait, CLOCK_PERIOD)):
                return
            self._publish_clock(min(self._pace.now(), log_time))

    def _publish_clock(self, nanoseconds: int) -> None:
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(nanoseconds, SECOND)
        self._clock_publisher.publish(message)

    def _publish(self, message: BagMessage) -> None:
        target = self._targets[message.topic]
        told = target.topic_name != message.topic
        data = as_measured(self._bag, message, self._serializer) if told else message.data
        target.publish(data)
        count, size = self._unacknowledged.get(message.topic, (0, 0))
        self._unacknowledged[message.topic] = (count + 1, size + len(data))
        if count + 1 >= _depth(self._bag.topics[message.topic]) or size + len(data) > QUEUE_SIZE:
            self._acknowledge()

    def _acknowledge(self) -> None:
        """Wait until all subscribers have what was sent, so that none is overwritten unseen."""
        for target in self._targets.values():
            target.wait_for_all_acked(Duration(seconds=ACKNOWLEDGE_TIMEOUT))
        self._unacknowledged.clear()

    def _await_answer(self, message: BagMessage) -> None:
        """Wait until the graph has answered for the time of a photograph or state."""
        wanted = stamp_of(message.data)
        deadline = time.monotonic() + self._patience
        with self._answers:
            while self._answered < wanted and not self._stopping.is_set():
                if not self._answers.wait(timeout=0.1) and time.monotonic() > deadline:
                    self.get_logger().warning(
                        f'no message on {self._lockstep} for the one at {wanted / SECOND:.3f} s '
                        f'within {self._patience:g} s; going on'
                    )
                    return
        # the wait is not part of the recording
        self._pace.begin(message.log_time)

    def destroy_node(self) -> None:
        """Stop playing before the node goes."""
        self._stopping.set()
        self._thread.join()
        super().destroy_node()


def main() -> None:
    """Run the node."""
    nodes: list[PlayerNode] = []

    def make() -> PlayerNode:
        nodes.append(PlayerNode())
        return nodes[0]

    run(make)
    sys.exit(int(any(node.failed for node in nodes)))


if __name__ == '__main__':
    main()
