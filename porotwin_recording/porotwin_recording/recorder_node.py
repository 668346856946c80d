"""Records the running graph into an MCAP bag, every message byte for byte."""

import math
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock as ClockMessage

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import POLL_S
from porotwin_core.ros.following import Writers, follow
from porotwin_core.ros.foreign_words import FewWords
from porotwin_core.ros.from_messages import nanoseconds_from_msg
from porotwin_core.ros.node import Diagnostics, TwinNode, declare, run
from porotwin_core.ros.senders import sender_name
from porotwin_recording.live.recorder import Recorder
from porotwin_recording.mcap.bag_records import TopicQos
from porotwin_recording.mcap.bag_writer import SplitRule, next_free_path
from porotwin_recording.mcap.interfaces import message_class
from porotwin_recording.mcap.serialization import SECOND
from porotwin_recording.mcap.topic_names import DOUBTFUL, TYPES

SEARCHES_PER_LOOK = 5
"""At every fifth search the qualities of all publishers are read, in case one took the place of
another. Between, they are read of topics whose number of publishers has changed."""

DIAGNOSTICS_PERIOD = 10.0
"""Period of this node's reports on /diagnostics [s]."""

MOST_BEFORE_CLOCK = 2000
"""Messages that wait for the first simulated time: the start of a graph takes seconds."""

QUEUE_DEPTH = 5000
"""Number of messages of one topic in the queue of this process, the largest of Fast DDS."""


class _Message(NamedTuple):
    topic: str
    data: bytes
    publish_time: int
    sequence: int


class RecorderNode(TwinNode):
    """Subscribes to all topics, or to those in the parameter `topics`, and records them.

    Log times come from this node's clock, which is simulated with `use_sim_time`. Publish times
    come from the publisher's computer. Hidden topics, such as topics of actions, are left out.
    A message that a foreign node could have sent is set aside, on a topic of its own, where its
    sender matters (`TYPES`): so no reader of the bag takes it. Topics of another rig are left out.
    So is the largest of the others when they carry more than `others_mb_s`, for a flood would fill
    the disk.

    Args:
        kwargs: passed on to `Node`.

    Raises:
        InputError: a parameter is wrong, or the bag exists or cannot be created.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('recorder', enable_rosout=False, **kwargs)
        output = declare(self, 'output', '', 'bag to write: a new folder, or a file .mcap')
        if not output:
            raise InputError("parameter 'output' of recorder: name the bag to write")
        continues = declare(
            self,
            'continues',
            False,
            'if output exists, add a file to the folder; a file .mcap gets a number',
        )
        bag = Path(output)
        if continues and bag.suffix == '.mcap':
            bag = next_free_path(bag)
        names = declare(self, 'topics', '', 'topics to record, separated by spaces; empty: all')
        self._selected = {self.resolve_topic_name(name) for name in names.split()}
        self._most_others = self._share_of_others()
        self._recorder = Recorder(
            bag,
            compress=declare(self, 'compress', True, 'compress the bag with zstd'),
            extend=continues,
            split=self._split_rule(),
            say=self.get_logger().info,
            warn=self.get_logger().warning,
        )
        try:
            self._begin()
        except BaseException:  # its thread would keep the process from ending, after Ctrl-C too
            self._recorder.stop()
            raise

    def _begin(self) -> None:
        """Subscribe to the topics that are there, and look for others from now on."""
        self._recorded: dict[str, TopicQos] = {}
        self._plain: dict[str, Subscription] = {}
        """Subscriptions to topics whose sender does not matter."""
        self._single_publisher: dict[str, bool] = {}
        self._types = {self.resolve_topic_name(topic): kind for topic, kind in TYPES.items()}
        self._writers = {self.resolve_topic_name(topic): Writers(self, topic) for topic in TYPES}
        self._doubts = FewWords(self.get_logger().warning, known=self._writers)
        self._refused: dict[str, str] = {}
        self._others: Counter[str] = Counter()
        """Bytes since the last report, by topic: messages that need not be the twin's."""
        self._floods: set[str] = set()
        self._told: set[tuple[str, str]] = set()
        self._publisher_counts: dict[str, int] = {}
        self._searches = 0
        self._before_clock: deque[_Message] = deque(maxlen=MOST_BEFORE_CLOCK)
        self._is_simulated = self.simulated
        self._simulated_time: int | None = None
        if self._is_simulated:
            follow(self, ClockMessage, '/clock', self._on_clock, qos_profile_sensor_data)
        self._diagnostics = Diagnostics(self)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(POLL_S, self._discover, clock=steady)
        self.create_timer(DIAGNOSTICS_PERIOD, self._report, clock=steady)
        self._discover()
        self.get_logger().info(f'recording into {self._recorder.path}')

    def _share_of_others(self) -> float:
        """Return how much others may send between two reports of this node [bytes]."""
        rate = declare(
            self,
            'others_mb_s',
            20.0,
            "what may come on topics that are not the twin's, in 10 s on average [MB/s]; 0: any",
            at_least=0.0,
        )
        return rate * 1e6 * DIAGNOSTICS_PERIOD if rate and not self._selected else math.inf

    def _split_rule(self) -> SplitRule:
        """Return when the bag goes on in another file.

        Raises:
            InputError: a parameter is negative or infinite.
        """
        size = declare(self, 'split_mb', 0.0, 'size of a file of the bag [MB]; 0: one file')
        duration = declare(self, 'split_s', 0.0, 'duration of a file of the bag [s]; 0: one file')
        for name, value in (('split_mb', size), ('split_s', duration)):
            if not 0.0 <= value < math.inf:
                raise InputError(
                    f"parameter '{name}' of recorder is {value:g}; give a number, 0 or more"
                )
        return SplitRule(round(size * 1e6), duration)

    def _discover(self) -> None:
        self._searches += 1
        all_again = self._searches % SEARCHES_PER_LOOK == 0
        present = [name for name, _ in self.get_topic_names_and_types()]
        for gone in self._refused.keys() - set(present) - self._floods:
            del self._refused[gone]
        for name in present:
            hidden = any(part.startswith('_') for part in name.split('/'))
            if hidden or (self._selected and name not in self._selected):
                continue
            if name in self._floods or self._is_of_another_rig(name):
                continue
            count = self.count_publishers(name)
            if self._publisher_counts.get(name, 0) == count and not all_again:
                continue
            self._publisher_counts[name] = count
            self._look(name, self.get_publishers_info_by_topic(name))

    def _is_of_another_rig(self, name: str) -> bool:
        """Return whether a topic stands in another namespace: a bag holds one rig. Tell it once."""
        elsewhere = name not in self._writers and any(
            name.endswith(f'/{topic}') for topic in TYPES if not topic.startswith('/')
        )
        if not elsewhere or self.get_namespace() == '/':
            return False
        if (name, '') not in self._told:
            self._told.add((name, ''))
            self.get_logger().warning(f'{name} is of another rig and not recorded')
        return True

    def _look(self, name: str, publishers: list[TopicEndpointInfo]) -> None:
        """Record a topic if that is possible; keep the reason if it is not."""
        try:
            if publishers:
                self._record_publishers(name, publishers)
        except InputError as error:
            if name not in self._refused:
                self.get_logger().warning(f'{name} is not recorded: {error}')
            self._refused[name] = str(error)
            return
        if self._refused.pop(name, '') and name in self._recorded:
            self.get_logger().info(f'{name} is recorded from now on')

    def _record_publishers(self, name: str, publishers: list[TopicEndpointInfo]) -> None:
        """Subscribe to the publishers of one type; those of other types are told and left out.

        The type is that of `TYPES`, else as before, else the first seen.

        Raises:
            InputError: see `_subscribe`.
        """
        kind = self._types.get(name, publishers[0].topic_type)
        fitting = [publisher for publisher in publishers if publisher.topic_type == kind]
        allowed = self._writers[name].allowed if name in self._writers else ()
        own = [
            one for one in fitting if sender_name(one) in allowed
        ]  # no stranger sets the quality
        if fitting:
            self._single_publisher[name] = len(fitting) == 1
            self._subscribe(name, kind, offered_qos(own or fitting))
        for other in {publisher.topic_type for publisher in publishers} - {kind}:
            if (name, other) not in self._told:
                self._told.add((name, other))
                self.get_logger().warning(f'{name} carries {other} too; only {kind} is recorded')

    def _subscribe(self, name: str, kind: str, offered: TopicQos) -> None:
        """Subscribe to a topic, or subscribe again if a new publisher offers a weaker quality.

        Raises:
            InputError: the type is not installed, or the bag holds the topic with another type.
        """
        message = message_class(kind)
        self._recorder.add_topic(name, kind, offered)
        recorded = self._recorded.get(name)
        if recorded == offered:
            return
        profile = _subscription_qos(offered)
        receive = self._callback(name)
        if name in self._writers:
            self._writers[name].subscribe(message, name, receive, profile, raw=True)
        else:
            if name in self._plain:
                self.destroy_subscription(self._plain[name])
            self._plain[name] = self.create_subscription(message, name, receive, profile, raw=True)
        self._types[name] = kind
        self._recorded[name] = offered

    def _callback(self, name: str) -> Callable[..., None]:
        def receive(data: bytes, info: dict[str, Any]) -> None:
            self._record(name, data, info)
            # All other messages in the queue are recorded at once. A call through the executor
            # costs more than the rest, and a queue that overflows meanwhile loses messages.
            own = self._writers.get(name)  # it may have subscribed anew
            subscription = self._plain.get(name) if own is None else own.subscription
            if subscription is None:  # a flood
                return
            handle = subscription.handle
            with handle:
                for _ in range(QUEUE_DEPTH):
                    more = handle.take_message(subscription.msg_type, True)
                    if more is None or name in self._floods:
                        return
                    self._record(name, *more)

        return receive

    def _record(self, name: str, data: bytes, info: dict[str, Any]) -> None:
        if name in self._writers:
            try:
                if not self._writers[name].check(info):
                    return
            except InputError as error:
                self._doubts.tell(name, f'{name} set aside: {error}')
                kind, offered = self._types[name], self._recorded[name]
                name = f'{name}/{DOUBTFUL}'
                self._recorder.add_topic(name, kind, offered)
        if name not in self._writers and self._is_left_out(name, len(data)):
            return
        sequence = info['publication_sequence_number'] or 0
        message = _Message(name, data, info['source_timestamp'], sequence)
        now = self._simulated_time if self._is_simulated else round(self.now() * SECOND)
        if now is None:
            # messages from before the first simulated time are logged at that time
            if len(self._before_clock) == MOST_BEFORE_CLOCK:
                self.get_logger().warning(
                    f'no node publishes /clock: only the newest {MOST_BEFORE_CLOCK} messages are '
                    'kept until one does; end the recording, or leave out use_sim_time',
                    once=True,
                )
            self._before_clock.append(message)
            return
        earlier = [*self._before_clock]
        self._before_clock.clear()
        for each in (*earlier, message):
            self._recorder.record(
                each.topic,
                each.data,
                log_time=now,
                publish_time=each.publish_time,
                sequence=each.sequence,
                single_publisher=self._single_publisher.get(each.topic, False),
            )

    def _is_left_out(self, name: str, size: int) -> bool:
        """Return whether a message of `size` bytes of others is of a flood; find new floods."""
        self._others[name] += size
        while self._others.total() > self._most_others:
            ((largest, _),) = self._others.most_common(1)
            del self._others[largest]
            if largest in self._floods:
                continue
            self._floods.add(largest)
            if largest in self._plain:
                self.destroy_subscription(self._plain.pop(largest))
            rate = self._most_others / DIAGNOSTICS_PERIOD / 1e6
            self._refused[largest] = (
                f"topics that are not the twin's carry more than {rate:g} MB/s, this one the most; "
                'record it into a bag of its own, or raise others_mb_s'
            )
            self.get_logger().error(f'{largest} is not recorded any more: {self._refused[largest]}')
        return name in self._floods

    def _on_clock(self, message: ClockMessage) -> None:
        self._simulated_time = nanoseconds_from_msg(message.clock)

    def _report(self) -> None:
        self._others.clear()
        lost = self._recorder.lost_count
        level = DiagnosticStatus.WARN if lost else DiagnosticStatus.OK
        summary = f'{self._recorder.message_count} messages recorded, {lost} lost'
        if self._recorder.disk_refuses:
            level = DiagnosticStatus.ERROR
            summary = f'the disk refuses data, free some space; {summary} so far'
        if self._refused:
            level = DiagnosticStatus.ERROR
            summary = f'{self._not_recorded()}; {summary}'
        self._diagnostics.report(level, summary, lost=lost)

    def _not_recorded(self) -> str:
        reasons = ', '.join(f'{name} ({why})' for name, why in sorted(self._refused.items()))
        return f'{len(self._refused)} topics not recorded: {reasons}'

    @property
    def failed(self) -> bool:
        """Whether received messages are missing in the bag, or a topic is not recorded."""
        return self._recorder.failed or bool(self._refused)

    def destroy_node(self) -> None:
        """Complete the bag, then destroy the node."""
        self._recorder.stop()
        if self._refused:
            self.get_logger().error(self._not_recorded())
        super().destroy_node()


def offered_qos(publishers: Iterable[TopicEndpointInfo]) -> TopicQos:
    """Return the quality of service that all `publishers` of a topic offer: the weakest of each.

    The depth of a publisher cannot be discovered and has its default value.
    """
    profiles = [publisher.qos_profile for publisher in publishers]
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
    latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return TopicQos(
        reliability='reliable' if reliable else 'best_effort',
        durability='transient_local' if latched else 'volatile',
    )


def _subscription_qos(offered: TopicQos) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=QUEUE_DEPTH,
        reliability=ReliabilityPolicy[offered.reliability.upper()],
        durability=DurabilityPolicy[offered.durability.upper()],
    )


def main() -> None:
    """Run the node; the exit status is 1 if messages or topics are missing in the bag."""
    nodes: list[RecorderNode] = []

    def make() -> RecorderNode:
        nodes.append(RecorderNode())
        return nodes[0]

    run(make, threads=1)
    sys.exit(int(any(node.failed for node in nodes)))


if __name__ == '__main__':
    main()
