"""The topics that a replay publishes: who gets each message, and whether it arrived."""

import threading
import time
from collections import Counter
from typing import Any

from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.node import TwinNode
from porotwin_recording.live.player import LATCHED_LIMIT, as_measured, played_topics
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import BagMessage, Topic
from porotwin_recording.mcap.definitions import message_definition, type_hash
from porotwin_recording.mcap.interfaces import message_class
from porotwin_recording.mcap.serialization import Serializer

QUEUE_DEPTH = 1000
"""The player waits for its subscribers after so many messages of one topic."""

QUEUE_SIZE = 64 << 20
"""The player waits for its subscribers after messages of this size on one topic [bytes]."""

ACKNOWLEDGE_TIMEOUT = 10.0
"""Longest wait for a subscriber [s]; Fast DDS requests acknowledgements every 3 s."""

ACKNOWLEDGE_PERIOD = 0.01
"""Period of the look for their acknowledgements [s]."""

RATES = 'porotwin_msgs/msg/WellRates'
"""Type of measured rates."""


class ReplayTopics:
    """Publishes the chosen topics of a bag, byte for byte, and waits for their subscribers.

    Args:
        node: the player.
        bag: the bag.
        selection: names, 'inputs' (data from the asset), or 'all'.
        stopping: ends every wait.

    Attributes:
        publishers: of every topic to play, by recorded name.
        played: number of messages by recorded name.
        silent: recorded names of topics whose subscribers did not acknowledge all of them.

    Raises:
        InputError: no topic can be played.
    """

    def __init__(
        self, node: TwinNode, bag: BagReader, selection: str, stopping: threading.Event
    ) -> None:
        """Make the publishers; warn about topics that cannot be played."""
        self._node, self._bag, self._stopping = node, bag, stopping
        self._serializer = Serializer()
        self._older: set[str] = set()
        """Topics of rates in an older version of their message."""
        self.publishers = self._make_publishers(selection)
        self.played: Counter[str] = Counter()
        self.silent: set[str] = set()
        self._setpoint: BagMessage | None = None
        self._unacknowledged: dict[str, tuple[int, int]] = {}

    def _make_publishers(self, selection: str) -> dict[str, Publisher]:
        """Return the publisher of every topic to play, by recorded name; warn about the others."""
        publishers: dict[str, Publisher] = {}
        for name in played_topics(self._bag, selection):
            topic = self._bag.topics[name]
            try:
                publishers[name] = self._make_publisher(topic, inputs=selection == 'inputs')
            except InputError as error:
                self._node.get_logger().warning(f'{name} is not played: {error}')
        if not publishers:
            raise InputError(
                f'{self._bag.path}: none of the chosen topics can be played, for their interfaces '
                'are not installed as they were recorded; choose others'
            )
        return publishers

    def _make_publisher(self, topic: Topic, *, inputs: bool) -> Publisher:
        """Return the publisher of a recorded topic; as an input, a setpoint becomes a measurement.

        Raises:
            InputError: the recorded version of the type is not installed.
        """
        qos = _publisher_qos(topic)
        if inputs and topic.name.endswith(f'/{topic_names.SETPOINT}'):
            kind = message_class(RATES)
            measured = topic.name.removesuffix(topic_names.SETPOINT) + topic_names.MEASURED
            return self._node.create_publisher(kind, measured, qos)
        if topic.type_name == RATES and topic.definition and not _is_installed(topic):
            self._older.add(topic.name)
            return self._node.create_publisher(message_class(RATES), topic.name, qos)
        return self._node.create_publisher(_installed_class(topic), topic.name, qos)

    def begin(self) -> None:
        """Forget the rates of the end: they do not hold at the start."""
        self._setpoint = None

    def repeat_setpoint(self, at: int) -> bool:
        """Publish the latest setpoint again, as rates measured `at` a time [ns]; tell if one is."""
        if self._setpoint is not None:
            self.publish(self._setpoint, at=at)
        return self._setpoint is not None

    def hearers(self, name: str) -> str:
        """Return the nodes that subscribe to the recorded topic `name`, in words."""
        infos = self._node.get_subscriptions_info_by_topic(self.publishers[name].topic_name)
        return ', '.join(sorted(info.node_name for info in infos)) or 'nobody'

    def publish(self, message: BagMessage, *, at: int | None = None) -> None:
        """Publish a message; a setpoint that is played as measured rates may be repeated.

        Rates that were told count until the twin chooses a setpoint. In a replay nobody pumps that
        one, so that the recorded rates are told again `at` each photograph [ns].
        """
        publisher, data = self.publishers[message.topic], message.data
        if publisher.topic_name != message.topic:
            self._setpoint = message
            data = as_measured(self._bag, message, self._serializer, at=at)
        elif message.topic in self._older:
            data = as_measured(self._bag, message, self._serializer)
        publisher.publish(data)
        self.played[message.topic] += at is None
        count, size = self._unacknowledged.get(message.topic, (0, 0))
        self._unacknowledged[message.topic] = (count + 1, size + len(data))
        if count + 1 >= _depth(self._bag.topics[message.topic]) or size + len(data) > QUEUE_SIZE:
            self.await_acknowledgements()

    def await_acknowledgements(self) -> None:
        """Wait until the subscribers have received all messages; a full queue would drop some.

        The end of the node ends the wait.
        """
        for name in self._unacknowledged:
            publisher = self.publishers[name]
            begin = time.monotonic()
            # a wait inside rclpy lets no other thread of Python run
            while not publisher.wait_for_all_acked(Duration()):
                if self._stopping.wait(ACKNOWLEDGE_PERIOD):
                    return
                if time.monotonic() - begin >= ACKNOWLEDGE_TIMEOUT:
                    self.silent.add(name)
                    break
        self._unacknowledged.clear()


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
    """Return the message class of a recorded topic.

    Raises:
        InputError: its type is not installed, or in another version than the recorded one.
    """
    kind = message_class(topic.type_name)
    if topic.definition and not _is_installed(topic):
        raise InputError(f"'{topic.type_name}' was recorded in another version than is installed")
    return kind


def _is_installed(topic: Topic) -> bool:
    """Return whether the recorded version of the type of a topic is the installed one."""
    installed = message_definition(topic.type_name)
    recorded, own = (type_hash(topic.type_name, one) for one in (topic.definition, installed))
    return recorded == own
