"""Plays a bag into a running graph, with /clock, as if the recorded events happened now."""

import contextlib
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Clock

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import HOUR_S, LONGEST_EXPERIMENT_S
from porotwin_core.clock.periods import POLL_S
from porotwin_core.ros.node import ENDED, Diagnostics, TwinNode, declare, run
from porotwin_core.ros.single_instance import DISCOVERY_S
from porotwin_recording.live.player import CLOCK, latched_before
from porotwin_recording.live.replay_audience import ReplayAudience
from porotwin_recording.live.replay_clock import ReplayClock
from porotwin_recording.live.replay_lock_step import LockStep
from porotwin_recording.live.replay_readiness import GraphSeen, missing
from porotwin_recording.live.replay_topics import QUEUE_DEPTH, ReplayTopics
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import BagMessage
from porotwin_recording.mcap.serialization import SECOND, stamp_of

CLOCK_PERIOD = 0.05
"""Period of /clock between two messages, in wall time [s]."""

PATIENCE = 60.0
"""Longest wait for the graph [s]: the start of all nodes on a loaded machine takes half of it."""

LOCK_STEP_SETTLE_PERIOD = 5.0
"""A replay in lock-step, where no message may be lost, begins when the graph was ready and
unchanged for so long [s]; another one after `DISCOVERY_S`.

Nodes learn of each other one by one. On a loaded machine one may miss the other's announcement.
Fast DDS repeats it after 3 s."""

PROGRESS_PERIOD = 5.0
"""Period of the lines that say what the player waits for [s]."""

FASTEST = 1000.0
"""Largest speed relative to the recording; 0 stands for no waiting at all."""

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
            self,
            'start_s',
            0.0,
            'where in the bag to start [s]',
            at_least=0.0,
            at_most=LONGEST_EXPERIMENT_S,
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
            at_least=POLL_S,
            at_most=HOUR_S,
        )
        self._replay_clock = ReplayClock(rate)
        self._start = self._checked_start(start_s)
        self._clock_publisher = self.create_publisher(Clock, CLOCK, QUEUE_DEPTH)
        self._stopping = threading.Event()
        self._topics = ReplayTopics(self, self._bag, selection, self._stopping)
        self._lock_step = LockStep()
        self._audience = ReplayAudience(self, self._lockstep, self._on_answer, self._on_status)
        self._unanswered = 0
        self._diagnostics = Diagnostics(self)
        self._thread = threading.Thread(target=self._run, name='player')
        self._thread.start()

    def _checked_start(self, start_s: float) -> int:
        """Return the log time [ns] that lies `start_s` after the first message."""
        start = self._bag.start_time + round(start_s * SECOND)
        if start > self._bag.end_time:
            length = (self._bag.end_time - self._bag.start_time) / SECOND
            raise InputError(f'{self._bag.path}: lasts {length:g} s; start before its end')
        return start

    def _run(self) -> None:
        try:
            self._await_graph()
            count = len(self._topics.publishers)
            self.get_logger().info(
                f'playing {count} topics of {self._bag.path} into {self._audience.found()}'
            )
            while not self._stopping.is_set():
                self._topics.begin()
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
            self._stopping.wait(DISCOVERY_S)

    def _await_graph(self) -> None:
        """Wait until the graph is ready, see `replay_readiness`, and stays so for a moment.

        Raises:
            InputError: the graph runs in real time, nobody listens after `discovery_s`, or in
                lock-step something is missing.
        """
        begin = settled_since = time.monotonic()
        due = begin + PROGRESS_PERIOD
        before: GraphSeen | None = None
        settle = LOCK_STEP_SETTLE_PERIOD if self._lockstep else DISCOVERY_S
        while (now := time.monotonic()) < begin + self._patience:
            seen = self._audience.seen(list(self._topics.publishers.values()))
            if seen.simulated is False:
                raise InputError(
                    f'{self._audience.found()} runs in real time; nothing was played: stop it and '
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
            if self._stopping.wait(POLL_S):
                return
        self._begin_without(missing(self._audience.seen(list(self._topics.publishers.values()))))

    def _begin_without(self, waits: list[str]) -> None:
        """Warn about what is missing, or refuse to begin in lock-step or without any listener.

        Raises:
            InputError: see above.
        """
        if not waits or (self._patience == 0.0 and not self._lockstep):
            return
        text = f'waited {self._patience:g} s for {"; ".join(waits)}'
        nobody = not any(p.get_subscription_count() for p in self._topics.publishers.values())
        if self._lockstep or nobody:
            raise InputError(f'{text}; nothing was played; start ./porotwin up --replay beside it')
        self.get_logger().warning(f'{text}; playing without')

    def _on_answer(self, data: bytes) -> None:
        self._lock_step.answer(stamp_of(data))

    def _on_status(self, status: DiagnosticStatus, values: dict[str, str]) -> None:
        """Take note of photographs that imaging refuses and nobody answers."""
        if status.level == DiagnosticStatus.ERROR and PHOTOGRAPH_TIME in values:
            with contextlib.suppress(ValueError, OverflowError):
                self._lock_step.refuse(float(values[PHOTOGRAPH_TIME]), status.message)

    def _play_once(self) -> None:
        names = list(self._topics.publishers)
        self._replay_clock.set(self._start)
        self._publish_clock(self._start)
        for message in latched_before(self._bag, names, self._start):
            self._topics.publish(message)
        self._lock_step.begin_anew()
        # a photograph before the first baseline waits for it and has no answer until then
        baselines = any(name.endswith(_BASELINE) for name in names)
        answerable = not baselines or bool(self._topics.played)
        for message in self._bag.messages(names, start=self._start):
            self._wait_until(message.log_time)
            if self._stopping.is_set():
                return
            driving = bool(self._lockstep) and message.topic.endswith(_DRIVING)
            if driving:
                # rates and baselines come before the photograph
                self._topics.await_acknowledgements()
                self._lock_step.ask(stamp_of(message.data))
            self._publish_clock(message.log_time)
            again = message.topic.endswith(_DRIVING)
            if again and self._topics.repeat_setpoint(stamp_of(message.data)) and driving:
                self._topics.await_acknowledgements()
            self._topics.publish(message)
            answerable = answerable or message.topic.endswith(_BASELINE)
            if driving and answerable:
                self._await_answer(message)
        self._topics.await_acknowledgements()
        if not self._stopping.is_set():
            self._report()

    def _report(self) -> None:
        """Say what was played and who received it; a message that is lost is a failure."""
        say = self.get_logger()
        say.info(f'{self._bag.path}: {self._topics.played.total()} messages played')
        for name, count in self._topics.played.items():
            topic, nodes = self._topics.publishers[name].topic_name, self._topics.hearers(name)
            if name in self._topics.silent:
                self.failed = True
                say.error(f'{count} on {topic}: not acknowledged by all of {nodes}')
            else:
                say.info(f'{count} on {topic}: acknowledged by {nodes}')
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
