"""Plays a bag into a running graph, with /clock, as if the recorded events happened now."""

import contextlib
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Set
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.duration import Duration
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import HOUR_S
from porotwin_core.ros.node import (
    DIAGNOSTICS,
    ENDED,
    HEARD_BY,
    Diagnostics,
    TwinNode,
    declare,
    hardware_id,
    run,
)
from porotwin_core.ros.service_answer import LONGEST_SEARCH_S
from porotwin_recording.live.player import (
    CLOCK,
    LATCHED_LIMIT,
    as_measured,
    latched_before,
    played_topics,
)
from porotwin_recording.live.replay_clock import ReplayClock
from porotwin_recording.live.replay_lock_step import LockStep
from porotwin_recording.live.replay_readiness import HUB, RECORDER, GraphSeen, PlayedTopic, missing
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import BagMessage, Topic
from porotwin_recording.mcap.definitions import message_definition, type_hash
from porotwin_recording.mcap.interfaces import message_class
from porotwin_recording.mcap.serialization import SECOND, Serializer, stamp_of

QUEUE_DEPTH = 1000
"""The player waits for its subscribers after so many messages of one topic."""

QUEUE_SIZE = 64 << 20
"""The player waits for its subscribers after messages of this size on one topic [bytes]."""

ACKNOWLEDGE_TIMEOUT = 10.0
"""Longest wait for a subscriber [s]; Fast DDS requests acknowledgements every 3 s."""

ACKNOWLEDGE_PERIOD = 0.01
"""Period of the look for their acknowledgements [s]."""

CLOCK_PERIOD = 0.05
"""Period of /clock between two messages, in wall time [s]."""

DISCOVERY_PERIOD = 0.05
"""Period of the search for subscribers and publishers [s]."""

PATIENCE = 60.0
"""Longest wait for the graph [s]: the start of all nodes on a loaded machine takes half of it."""

SETTLE_PERIOD = 1.0
"""The replay begins when the graph was ready and unchanged for so long [s].

A subscriber learns of the player a moment after the player learns of the subscriber.
"""

LOCK_STEP_SETTLE_PERIOD = 5.0
"""The same in lock-step [s], where no message may be lost.

Nodes learn of each other one by one. On a loaded machine one may miss the other's announcement.
Fast DDS repeats it after 3 s."""

PROGRESS_PERIOD = 5.0
"""Period of the lines that say what the player waits for [s]."""

FASTEST = 1000.0
"""Largest speed relative to the recording; 0 stands for no waiting at all."""

SHORTEST_WAIT = 0.1
"""Shortest limit of a wait for an answer [s]: less than any cycle takes."""


DECADE = 3.2e8
"""Longer than any recording [s]."""

RATES = 'porotwin_msgs/msg/WellRates'
"""Type of measured rates."""

PHOTOGRAPH_TIME = 'photograph_time'
"""Value in the diagnostics of imaging: the stamp of the photograph that it refuses [s]."""

_BASELINE = f'/{topic_names.BASELINE}'

_DRIVING = (f'/{topic_names.IMAGE}', f'/{topic_names.STATE_REFRESHED}')
"""Topics that start a cycle of the graph with every message."""

OpenBagFn = Callable[[str], BagReader]
"""Opens the bag at a path; raises InputError if that fails."""


class PlayerNode(TwinNode):
    """Publishes the messages of a bag, byte for byte, at their log times.

    The process ends with the bag unless the parameter `loop` is set. The parameter `lockstep`
    names a topic whose messages begin with a header, for example hub/cycle. Then the player waits
    after every photograph (or refreshed state) for a message there with the same or a later stamp,
    so that a slow graph receives all of them.

    Args:
        open_bag: opens the bag.
        kwargs: passed on to `Node`.

    Attributes:
        failed: whether playing ended with an error.

    Raises:
        InputError: a parameter is wrong, the bag cannot be read, or no topic can be played.
    """

    def __init__(self, open_bag: OpenBagFn = BagReader, **kwargs: Any) -> None:
        super().__init__('player', enable_rosout=False, **kwargs)
        self.failed = False
        self._bag = open_bag(declare(self, 'bag', '', 'bag to play: folder or .mcap file'))
        selection = declare(
            self, 'topics', 'inputs', "names, 'inputs' (data from the asset), or 'all'"
        )
        rate = declare(
            self,
            'rate',
            1.0,
            'speed relative to the recording; 0: without waiting',
            at_least=0.0,
            at_most=FASTEST,
        )
        start_s = declare(
            self, 'start_s', 0.0, 'where in the bag to start [s]', at_least=0.0, at_most=DECADE
        )
        self._loop = declare(self, 'loop', False, 'start again at the end')
        self._patience = declare(
            self,
            'discovery_s',
            PATIENCE,
            'longest wait for subscribers, and in lock-step for the answering node [s]',
            at_least=0.0,
            at_most=HOUR_S,
        )
        lockstep = declare(
            self, 'lockstep', '', 'topic of the answer to wait for after every photograph'
        )
        self._lockstep = self.resolve_topic_name(lockstep) if lockstep else ''
        self._lockstep_timeout = declare(
            self,
            'lockstep_timeout_s',
            60.0,
            'longest wait for that answer [s]',
            at_least=SHORTEST_WAIT,
            at_most=HOUR_S,
        )
        self._replay_clock = ReplayClock(rate)
        self._start = self._checked_start(start_s)
        self._serializer = Serializer()
        self._clock_publisher = self.create_publisher(Clock, CLOCK, QUEUE_DEPTH)
        self._older: set[str] = set()
        """Topics of rates in an older version of their message."""
        self._publishers_by_topic = self._make_publishers(selection)
        self._lock_step = LockStep()
        self._deaf = self._connections_needed()
        self._answer_subscription: Subscription | None = None
        self._unanswered = 0
        self._setpoint: BagMessage | None = None
        self._asking: dict[str, AsyncParameterClient] = {}
        self._asked: dict[str, Any] = {}
        self._ask_again: dict[str, float] = {}
        self._stopping = threading.Event()
        self._unacknowledged: dict[str, tuple[int, int]] = {}
        self._diagnostics = Diagnostics(self)
        self._played: Counter[str] = Counter()
        self._silent: set[str] = set()
        self._thread = threading.Thread(target=self._run, name='player')
        self._thread.start()

    def _connections_needed(self) -> set[tuple[str, str]]:
        """Return the senders and receivers of the twin that a photograph's answer passes through.

        The player sees that both run, but not whether they have found each other.
        """
        if not self._lockstep:
            return set()
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, QUEUE_DEPTH)
        answers = self._lockstep == self.resolve_topic_name(topic_names.CYCLE)
        return {('imaging', HUB), *([(HUB, self.get_name())] if answers else [])}

    def _checked_start(self, start_s: float) -> int:
        """Return the log time [ns] that lies `start_s` after the first message."""
        start = self._bag.start_time + round(start_s * SECOND)
        if start > self._bag.end_time:
            length = (self._bag.end_time - self._bag.start_time) / SECOND
            raise InputError(f'{self._bag.path}: lasts {length:g} s; start before its end')
        return start

    def _make_publishers(self, selection: str) -> dict[str, Publisher]:
        """Return the publisher of every topic to play, by recorded name; warn about the others."""
        publishers: dict[str, Publisher] = {}
        for name in played_topics(self._bag, selection):
            topic = self._bag.topics[name]
            try:
                publishers[name] = self._make_publisher(topic, inputs=selection == 'inputs')
            except InputError as error:
                self.get_logger().warning(f'{name} is not played: {error}')
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
            return self.create_publisher(kind, measured, qos)
        if topic.type_name == RATES and topic.definition and not _is_installed(topic):
            self._older.add(topic.name)
            return self.create_publisher(message_class(RATES), topic.name, qos)
        return self.create_publisher(_installed_class(topic), topic.name, qos)

    def _run(self) -> None:
        try:
            self._await_graph()
            count = len(self._publishers_by_topic)
            self.get_logger().info(
                f'playing {count} topics of {self._bag.path} into {self._graph_found()}'
            )
            while not self._stopping.is_set():
                self._setpoint = None  # rates of the end do not hold at the start
                self._play_once()
                if not self._loop:
                    break
        except InputError as error:
            self.failed = True
            self.get_logger().error(str(error))
        except Exception as error:
            # during a shutdown the context disappears while this thread still publishes
            if self.context.ok():
                self.failed = True
                self.get_logger().fatal(f'playing failed: {error!r}')
        finally:
            if not self._stopping.is_set():
                self._tell_end()
                rclpy.try_shutdown(context=self.context)

    def _tell_end(self) -> None:
        """Tell the page that the player leaves the graph because its work is over."""
        level = DiagnosticStatus.WARN if self.failed else DiagnosticStatus.OK
        if self.context.ok():
            self._diagnostics.report(level, 'the bag has ended', **{ENDED: True})
            self._stopping.wait(SETTLE_PERIOD)

    def _await_graph(self) -> None:
        """Wait until the graph is ready, see `replay_readiness`, and stays so for a moment.

        Raises:
            InputError: the graph runs in real time, nobody listens after `discovery_s`, or in
                lock-step something is missing.
        """
        begin = settled_since = time.monotonic()
        due = begin + PROGRESS_PERIOD
        before: GraphSeen | None = None
        settle = LOCK_STEP_SETTLE_PERIOD if self._lockstep else SETTLE_PERIOD
        while (now := time.monotonic()) < begin + self._patience:
            seen = self._seen()
            if seen.simulated is False:
                raise InputError(
                    f'{self._graph_found()} runs in real time; nothing was played: stop it and '
                    'start ./porotwin up --replay, or choose another --domain'
                )
            waits = missing(seen)
            if waits or seen != before:
                before, settled_since = seen, now
            elif now - settled_since >= settle:
                return
            if waits and now >= due:
                due += PROGRESS_PERIOD
                self.get_logger().info(
                    f'waiting for {"; ".join(waits)} ({now - begin:.0f} of {self._patience:g} s)'
                )
            if self._stopping.wait(DISCOVERY_PERIOD):
                return
        self._begin_without(missing(self._seen()))

    def _begin_without(self, waits: list[str]) -> None:
        """Warn about what is missing, or refuse to begin in lock-step or without any listener.

        Raises:
            InputError: see above.
        """
        if not waits or (self._patience == 0.0 and not self._lockstep):
            return
        text = f'waited {self._patience:g} s for {"; ".join(waits)}'
        nobody = not any(p.get_subscription_count() for p in self._publishers_by_topic.values())
        if self._lockstep or nobody:
            raise InputError(f'{text}; nothing was played; start ./porotwin up --replay beside it')
        self.get_logger().warning(f'{text}; playing without')

    def _seen(self) -> GraphSeen:
        space = self.get_namespace()
        nodes = frozenset(
            name
            for name, namespace in self.get_node_names_and_namespaces()
            if namespace == space and name != self.get_name()
        )
        topics = tuple(
            PlayedTopic(
                publisher.topic_name,
                publisher.get_subscription_count(),
                tuple(
                    sorted(
                        info.node_name
                        for info in self.get_subscriptions_info_by_topic(publisher.topic_name)
                    )
                ),
            )
            for publisher in self._publishers_by_topic.values()
        )
        services = frozenset(
            name.removeprefix(f'{space}/')
            for name, _ in self.get_service_names_and_types()
            if name.startswith(f'{space}/')
        )
        told = self._told(HUB, nodes, ['use_sim_time', 'rig'])
        simulated = None if told is None else bool(told[0].bool_value)
        return GraphSeen(
            nodes,
            topics,
            services,
            self._recorded(nodes),
            self._hears_answers(),
            simulated,
            tuple(sorted(self._deaf)),
        )

    def _graph_found(self) -> str:
        """Return the graph that the player sees: its namespace, and the rig of its hub."""
        told = self._told(HUB, (), [])
        rig = told[1].string_value if told is not None else ''
        return f'the graph {self.get_namespace()}' + (f' of the rig {rig}' if rig else '')

    def _recorded(self, nodes: Set[str]) -> frozenset[str] | None:
        """Return the topics that the node `recorder` takes; None: all, or it has not answered."""
        told = self._told(RECORDER, nodes, ['topics'])
        if told is None:
            return None
        (value,) = told
        names = value.string_value.split()
        return frozenset(self.resolve_topic_name(name) for name in names) if names else None

    def _told(self, name: str, nodes: Iterable[str], parameters: list[str]) -> list[Any] | None:
        """Return the values of parameters of one of the `nodes`; None: it has not answered yet.

        A node may lose its first answers, because it discovers this one later. It is asked again.
        """
        asked = self._asked.get(name)
        waits = asked is None or not asked.done()
        if waits and name in nodes and time.monotonic() >= self._ask_again.get(name, 0.0):
            if name not in self._asking:
                self._asking[name] = AsyncParameterClient(self, name)
            client = self._asking[name]
            if client.services_are_ready():
                self._asked[name] = asked = client.get_parameters(parameters)
                self._ask_again[name] = time.monotonic() + LONGEST_SEARCH_S
        if asked is None or not asked.done():
            return None
        values: list[Any] = asked.result().values
        return values if len(values) else None

    def _hears_answers(self) -> bool | None:
        """Return whether the answering node is connected; None without lock-step.

        The running graph knows the type of the answers, so the subscription waits for it.
        """
        if not self._lockstep:
            return None
        if self._answer_subscription is None:
            types = dict(self.get_topic_names_and_types()).get(self._lockstep, [])
            if not types or not self.count_publishers(self._lockstep):
                return False
            self._answer_subscription = self.create_subscription(
                message_class(types[0]), self._lockstep, self._on_answer, QUEUE_DEPTH, raw=True
            )
        return bool(self._answer_subscription.get_publisher_count() > 0)

    def _on_answer(self, data: bytes) -> None:
        self._lock_step.answer(stamp_of(data))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Take note of connections, and of photographs that imaging refuses and nobody answers."""
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.hardware_id == hardware_id(self):
                hearers = values.get(HEARD_BY, '').split()
                self._deaf -= {(status.name, hearer) for hearer in hearers}
            if status.level != DiagnosticStatus.ERROR or PHOTOGRAPH_TIME not in values:
                continue
            with contextlib.suppress(ValueError, OverflowError):
                self._lock_step.refuse(float(values[PHOTOGRAPH_TIME]), status.message)

    def _play_once(self) -> None:
        names = list(self._publishers_by_topic)
        self._replay_clock.set(self._start)
        self._publish_clock(self._start)
        for message in latched_before(self._bag, names, self._start):
            self._publish(message)
        self._lock_step.begin_anew()
        # a photograph before the first baseline waits for it and has no answer until then
        baselines = any(name.endswith(_BASELINE) for name in names)
        answerable = not baselines or bool(self._played)
        for message in self._bag.messages(names, start=self._start):
            self._wait_until(message.log_time)
            if self._stopping.is_set():
                return
            driving = bool(self._lockstep) and message.topic.endswith(_DRIVING)
            if driving:
                self._await_acknowledgements()  # rates and baselines come before the photograph
                self._lock_step.ask(stamp_of(message.data))
            self._publish_clock(message.log_time)
            if self._setpoint is not None and message.topic.endswith(_DRIVING):
                self._publish(self._setpoint, at=stamp_of(message.data))
                if driving:
                    self._await_acknowledgements()
            self._publish(message)
            answerable = answerable or message.topic.endswith(_BASELINE)
            if driving and answerable:
                self._await_answer(message)
        self._await_acknowledgements()
        if not self._stopping.is_set():
            self._report()

    def _report(self) -> None:
        """Say what was played and who received it; a message that is lost is a failure."""
        say = self.get_logger()
        say.info(f'{self._bag.path}: {self._played.total()} messages played')
        for name, count in self._played.items():
            publisher = self._publishers_by_topic[name]
            infos = self.get_subscriptions_info_by_topic(publisher.topic_name)
            nodes = ', '.join(sorted(info.node_name for info in infos)) or 'nobody'
            if name in self._silent:
                self.failed = True
                say.error(f'{count} on {publisher.topic_name}: not acknowledged by all of {nodes}')
            else:
                say.info(f'{count} on {publisher.topic_name}: acknowledged by {nodes}')
        if self._unanswered:
            self.failed = True
            say.error(f'{self._unanswered} photographs without an answer on {self._lockstep}')

    def _wait_until(self, log_time: int) -> None:
        """Wait for `log_time` [ns] and publish the clock meanwhile."""
        while (wait := self._replay_clock.wait_for(log_time)) > 0:
            if self._stopping.wait(min(wait, CLOCK_PERIOD)):
                return
            self._publish_clock(min(self._replay_clock.now(), log_time))

    def _publish_clock(self, nanoseconds: int) -> None:
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(nanoseconds, SECOND)
        self._clock_publisher.publish(message)

    def _publish(self, message: BagMessage, *, at: int | None = None) -> None:
        """Publish a message; a setpoint that is played as measured rates may be repeated.

        Rates that were told count until the twin chooses a setpoint. In a replay nobody pumps that
        one, so that the recorded rates are told again `at` each photograph [ns].
        """
        publisher, data = self._publishers_by_topic[message.topic], message.data
        if publisher.topic_name != message.topic:
            self._setpoint = message
            data = as_measured(self._bag, message, self._serializer, at=at)
        elif message.topic in self._older:
            data = as_measured(self._bag, message, self._serializer)
        publisher.publish(data)
        self._played[message.topic] += at is None
        count, size = self._unacknowledged.get(message.topic, (0, 0))
        self._unacknowledged[message.topic] = (count + 1, size + len(data))
        if count + 1 >= _depth(self._bag.topics[message.topic]) or size + len(data) > QUEUE_SIZE:
            self._await_acknowledgements()

    def _await_acknowledgements(self) -> None:
        """Wait until the subscribers have received all messages; a full queue would drop some.

        The end of the node ends the wait.
        """
        for name in self._unacknowledged:
            publisher = self._publishers_by_topic[name]
            begin = time.monotonic()
            # a wait inside rclpy lets no other thread of Python run
            while not publisher.wait_for_all_acked(Duration()):
                if self._stopping.wait(ACKNOWLEDGE_PERIOD):
                    return
                if time.monotonic() - begin >= ACKNOWLEDGE_TIMEOUT:
                    self._silent.add(name)
                    break
        self._unacknowledged.clear()

    def _await_answer(self, message: BagMessage) -> None:
        """Wait until the graph has answered or refused a photograph or state.

        An answer that does not come within `lockstep_timeout_s` is counted as a failure.
        """
        stamp = stamp_of(message.data)
        try:
            if reason := self._lock_step.wait(stamp, self._lockstep_timeout, self._stopping):
                self.get_logger().warning(f'refused: {reason}')
        except TimeoutError:
            self.get_logger().warning(
                f'no message on {self._lockstep} for the one at {stamp / SECOND:.3f} s '
                f'within {self._lockstep_timeout:g} s; going on'
            )
            self._unanswered += 1
        # the wait is not part of the recording
        self._replay_clock.set(message.log_time)

    def destroy_node(self) -> None:
        """Stop playing, then destroy the node."""
        self._stopping.set()
        self._thread.join()
        super().destroy_node()


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


def main(open_bag: OpenBagFn = BagReader) -> None:
    """Run the node; the exit status is 1 if playing failed."""
    nodes: list[PlayerNode] = []

    def make() -> PlayerNode:
        nodes.append(PlayerNode(open_bag))
        return nodes[0]

    run(make)
    sys.exit(int(any(node.failed for node in nodes)))


if __name__ == '__main__':
    main()
