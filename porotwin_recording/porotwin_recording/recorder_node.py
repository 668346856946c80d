"""Records the running graph into an MCAP bag, every message as it came over the wire."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
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

from porotwin_core.errors import InputError
from porotwin_core.node import Diagnostics, declare, run
from porotwin_recording.bag_writer import free_name
from porotwin_recording.interfaces import message_class
from porotwin_recording.recorder import Recorder
from porotwin_recording.serialization import SECOND
from porotwin_recording.topic import TopicQos

DISCOVERY_PERIOD = 0.2
"""How often new topics are looked for [s]."""

DIAGNOSTICS_PERIOD = 10.0

QUEUE_DEPTH = 5000
"""Messages of one topic that wait for this process, the most that Fast DDS keeps."""


def offered_qos(publishers: Iterable[TopicEndpointInfo]) -> TopicQos:
    """Return what all `publishers` of a topic offer: the weakest of each property.

    The depth of a publisher cannot be discovered; the default stands for it.
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


_Message = tuple[str, bytes, int, int]
"""Topic, content, publish time [ns] and number."""


class RecorderNode(Node):
    """Subscribes to every topic it finds, or to those of `topics`, and writes what arrives.

    Log times are those of this node's clock (simulated with `use_sim_time`), publish times those
    of the publisher's computer. Topics of actions and other hidden ones are left out.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('recorder', enable_rosout=False, **kwargs)
        output = declare(self, 'output', '', 'bag to write: a new folder, or a file .mcap')
        if not output:
            raise InputError("parameter 'output' of recorder: name the bag to write")
        continues = declare(
            self, 'continues', False, 'where output exists, go on in output_2, _3, ...'
        )
        bag = free_name(Path(output)) if continues else Path(output)
        names = declare(self, 'topics', '', 'topics to record, separated by spaces; empty: all')
        self._wanted = {self.resolve_topic_name(name) for name in names.split()}
        self._recorder = Recorder(
            bag,
            compress=declare(self, 'compress', True, 'compress the bag with zstd'),
            say=self.get_logger().info,
            warn=self.get_logger().warning,
        )
        self._taken: dict[str, tuple[Subscription, TopicQos]] = {}
        self._alone: dict[str, bool] = {}
        self._refused: set[str] = set()
        self._early: list[_Message] = []
        self._is_simulated = bool(self.get_parameter('use_sim_time').value)
        self._simulated: int | None = None
        if self._is_simulated:
            self.create_subscription(
                ClockMessage, '/clock', self._on_clock, qos_profile_sensor_data
            )
        self._diagnostics = Diagnostics(self)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DISCOVERY_PERIOD, self._discover, clock=steady)
        self.create_timer(DIAGNOSTICS_PERIOD, self._report, clock=steady)
        self._discover()
        self.get_logger().info(f'recording into {bag}')

    def _discover(self) -> None:
        for name, types in self.get_topic_names_and_types():
            hidden = any(part.startswith('_') for part in name.split('/'))
            if hidden or name in self._refused or (self._wanted and name not in self._wanted):
                continue
            publishers = self.get_publishers_info_by_topic(name)
            if not publishers:
                continue
            self._alone[name] = len(publishers) == 1
            try:
                self._take(name, types, offered_qos(publishers))
            except InputError as error:
                self._refused.add(name)
                self.get_logger().warning(f'{name} is not recorded: {error}')

    def _take(self, name: str, types: list[str], offered: TopicQos) -> None:
        """Subscribe to a topic, or again where a new publisher offers less than the first."""
        if name in self._taken:
            subscription, known = self._taken[name]
            if known == offered:
                return
            self.destroy_subscription(subscription)
        if len(types) > 1:
            raise InputError(f'it carries {" and ".join(types)}; give the topic one type')
        kind = message_class(types[0])
        self._recorder.add_topic(name, types[0], offered)
        subscription = self.create_subscription(
            kind, name, self._taker(name), _subscription_qos(offered), raw=True
        )
        self._taken[name] = (subscription, offered)

    def _taker(self, name: str) -> Callable[..., None]:
        def take(data: bytes, info: dict[str, Any]) -> None:
            self._record(name, data, info)
            # What else has arrived is taken at once: a turn of the executor costs more than all
            # the rest, and a queue that overflows meanwhile loses messages.
            subscription, _ = self._taken[name]
            handle = subscription.handle
            with handle:
                while (more := handle.take_message(subscription.msg_type, True)) is not None:
                    self._record(name, *more)

        return take

    def _record(self, name: str, data: bytes, info: dict[str, Any]) -> None:
        message = (
            name,
            data,
            info['source_timestamp'],
            info['publication_sequence_number'] or 0,
        )
        now = self._simulated if self._is_simulated else self.get_clock().now().nanoseconds
        if now is None:
            # simulated time has not begun: what arrives belongs to its first moment
            self._early.append(message)
            return
        early, self._early = self._early, []
        for topic, content, published, number in (*early, message):
            self._recorder.record(
                topic,
                content,
                log_time=now,
                publish_time=published,
                sequence=number,
                alone=self._alone[topic],
            )

    def _on_clock(self, message: ClockMessage) -> None:
        self._simulated = message.clock.sec * SECOND + message.clock.nanosec

    def _report(self) -> None:
        lost = self._recorder.losses.total + self._recorder.dropped
        level = DiagnosticStatus.WARN if lost else DiagnosticStatus.OK
        count = self._recorder.message_count
        self._diagnostics.report(level, f'{count} messages recorded, {lost} lost', lost=lost)

    def destroy_node(self) -> None:
        """Complete the bag before the node goes."""
        self._recorder.stop()
        super().destroy_node()


def main() -> None:
    """Run the node."""
    run(RecorderNode, threads=1)


if __name__ == '__main__':
    main()
