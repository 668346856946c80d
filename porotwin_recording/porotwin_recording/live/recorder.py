"""Writes received messages to a bag in a thread of its own, and counts every loss."""

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from porotwin_recording.mcap.bag_records import TopicQos
from porotwin_recording.mcap.bag_writer import BagWriter, SplitRule

FLUSH_PERIOD = 1.0
"""Longest time until a received message survives a kill of the process [s]."""

BACKLOG_LIMIT = 256 << 20
"""Largest size of messages in memory while the disk is slow or full [bytes]; more are dropped."""

LogFn = Callable[[str], None]
"""Reports one line to the user."""


@dataclass(frozen=True, slots=True)
class _Received:
    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


_NOTHING = _Received('', b'', 0, 0, 0)
"""Stands for the end of a waiting time without a message."""


class LossCounter:
    """Detects lost messages from gaps in their publishers' counts.

    Attributes:
        lost: number of lost messages by topic.
    """

    def __init__(self) -> None:
        self.lost: dict[str, int] = {}
        self._last: dict[str, int] = {}

    def observe(self, topic: str, sequence: int, *, single_publisher: bool) -> None:
        """Take the count of one message into account.

        A count that decreases belongs to a restarted publisher and is no loss.

        Args:
            topic: absolute name.
            sequence: the publisher's count; 0 if unknown.
            single_publisher: whether the topic has one publisher; counts of several are not
                comparable.
        """
        last = self._last.get(topic)
        if sequence == 0 or not single_publisher:
            self._last.pop(topic, None)
            return
        self._last[topic] = sequence
        if last is not None and sequence > last + 1:
            self.lost[topic] = self.lost.get(topic, 0) + sequence - last - 1

    @property
    def total(self) -> int:
        """Number of messages lost on all topics."""
        return sum(self.lost.values())


class Recorder:
    """Writes messages to a new bag; `record` never waits for the disk.

    If the disk refuses data, the recorder warns once and tries again every second. Messages beyond
    the backlog limit are dropped and counted meanwhile. If somebody removes the file or its folder,
    the recorder writes it again from its open file.

    Args:
        bag: the bag, a new folder or a file .mcap.
        compress: compress the bag with zstd.
        extend: if the folder `bag` exists, add a file to it.
        split: when to go on in another file of the folder.
        say: receives the final report.
        warn: receives warnings.
        backlog_limit: largest size of messages in memory [bytes].

    Attributes:
        losses: messages that were lost on the way here.
        dropped: messages that arrived here and are not in the bag.
        failed: whether messages were dropped or the end could not be written.

    Raises:
        InputError: the bag exists already or cannot be created.
    """

    def __init__(
        self,
        bag: Path,
        *,
        compress: bool = True,
        extend: bool = False,
        split: SplitRule = SplitRule(),  # noqa: B008  a frozen value
        say: LogFn = print,
        warn: LogFn = print,
        backlog_limit: int = BACKLOG_LIMIT,
    ) -> None:
        self.losses = LossCounter()
        self.dropped = 0
        self.failed = False
        self._writer = BagWriter(bag, compress=compress, extend=extend, split=split)
        self._say = say
        self._warn = warn
        self._backlog_limit = backlog_limit
        self._backlog = 0
        self._backlog_lock = threading.Lock()
        self._received = 0
        self._queue: queue.SimpleQueue[_Received | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._disk_refuses = False
        self._reported_losses = 0
        self._thread = threading.Thread(target=self._work, name='recorder')
        self._thread.start()

    @property
    def path(self) -> Path:
        """The file that is written."""
        return self._writer.file

    @property
    def message_count(self) -> int:
        """Number of messages that are on the disk and can be read."""
        return self._writer.readable_count

    @property
    def disk_refuses(self) -> bool:
        """Whether the disk accepts no data at present."""
        return self._disk_refuses

    @property
    def lost_count(self) -> int:
        """Number of messages that are not in the bag: lost or dropped."""
        return self.losses.total + self.dropped

    def add_topic(self, name: str, type_name: str, qos: TopicQos) -> None:
        """Add a topic (absolute name) of the type pkg/msg/Name; must precede its messages.

        Raises:
            InputError: the type is not installed, or the topic has another type already.
        """
        with self._lock:
            self._writer.add_topic(name, type_name, qos=qos)

    def record(
        self,
        topic: str,
        data: bytes,
        *,
        log_time: int,
        publish_time: int,
        sequence: int = 0,
        single_publisher: bool = True,
    ) -> None:
        """Accept a serialized message (CDR); see `BagWriter.write` and `LossCounter.observe`."""
        self.losses.observe(topic, sequence, single_publisher=single_publisher)
        with self._backlog_lock:
            self._received += 1
            if self._backlog + len(data) > self._backlog_limit:
                self.dropped += 1
                return
            self._backlog += len(data)
        self._queue.put(_Received(topic, data, log_time, publish_time, sequence))

    def stop(self) -> None:
        """Write all messages in memory, complete the bag and report the numbers."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._queue.put(None)
        self._thread.join()
        with self._lock:
            try:
                self._writer.close()
            except OSError as error:
                self.failed = True
                self._warn(
                    f'{self._writer.path}: the end could not be written ({error.strerror}); '
                    f'{self._writer.readable_count} messages remain readable'
                )
        count = self._writer.readable_count
        self.dropped = self._received - count
        self.failed = self.failed or self.dropped > 0
        self._say(f'{self._writer.path}: {count} messages recorded, {self.lost_count} lost')

    def _work(self) -> None:
        due = time.monotonic() + FLUSH_PERIOD
        while True:
            received = self._next(due - time.monotonic())
            if received is None or (self._disk_refuses and self._stopping.is_set()):
                return  # `stop` counts what is left
            try:
                if received is not _NOTHING:
                    self._write(received)
                if time.monotonic() >= due:
                    self._flush()
                    due = time.monotonic() + FLUSH_PERIOD
            except OSError as error:
                self._wait_for_disk(error)
            except Exception as error:
                # one faulty message must not end the recording
                self.dropped += 1
                self._warn(f'{self._writer.path}: a message on {received.topic} is lost: {error!r}')

    def _next(self, timeout: float) -> _Received | None:
        """Return the next message, None at the end, or `_NOTHING` after `timeout` [s]."""
        try:
            return self._queue.get(timeout=max(0.0, timeout))
        except queue.Empty:
            return _NOTHING

    def _write(self, received: _Received) -> None:
        with self._backlog_lock:
            self._backlog -= len(received.data)
        with self._lock:
            self._writer.write(
                received.topic,
                received.data,
                log_time=received.log_time,
                publish_time=received.publish_time,
                sequence=received.sequence,
            )

    def _flush(self) -> None:
        with self._lock:
            restored = self._writer.restore_if_removed()
            self._writer.flush()
        if restored:
            self._warn(f'{self._writer.file}: was removed and is written again, without a loss')
        self._report_losses()

    def _wait_for_disk(self, error: OSError) -> None:
        """Wait until the disk accepts data again, or until `stop`."""
        self._disk_refuses = True
        self._warn(
            f'{self._writer.path}: the disk refuses data ({error.strerror}); free some space, '
            'then recording continues'
        )
        stopping = False
        while not stopping:
            stopping = self._stopping.wait(FLUSH_PERIOD)
            try:
                self._flush()
            except OSError:
                continue
            self._disk_refuses = False
            self._warn(f'{self._writer.path}: the disk accepts data again, recording continues')
            return

    def _report_losses(self) -> None:
        lost = self.lost_count
        if lost > self._reported_losses:
            worst = max(self.losses.lost, key=lambda topic: self.losses.lost[topic], default='')
            where = f', most on {worst}' if worst else ''
            self._warn(f'{lost - self._reported_losses} messages lost{where}; {lost} in total')
            self._reported_losses = lost
