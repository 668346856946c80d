"""What a recorder does with messages: to disk in a thread of its own, every loss counted."""

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from porotwin_recording.bag_writer import BagWriter
from porotwin_recording.topic import TopicQos

FLUSH_PERIOD = 1.0
"""Longest time that a message waits before it survives a kill of the process [s]."""

BACKLOG_LIMIT = 256 << 20
"""Messages that wait while the disk is slow or full, beyond which they are dropped [bytes]."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class _Waiting:
    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


_NOTHING = _Waiting('', b'', 0, 0, 0)


class LossCounter:
    """Finds lost messages of topics whose publisher counts them."""

    def __init__(self) -> None:
        self.lost: dict[str, int] = {}
        self._last: dict[str, int] = {}

    def see(self, topic: str, sequence: int, *, alone: bool) -> None:
        """Take note of a message's number (0: not counted) on a topic.

        Gaps mean losses only where one publisher is `alone` on the topic; a number that falls
        back means that it started anew.
        """
        last = self._last.get(topic)
        if sequence == 0 or not alone:
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
    """Writes a bag from messages given by `record`, which never waits for the disk.

    When the disk refuses, `warn` is told in one line, writing is tried again every second, and
    messages beyond the backlog are dropped and counted; when it takes data again, recording goes
    on. What was flushed survives the end of the process.

    Raises:
        InputError: the bag exists already or cannot be made.
    """

    def __init__(
        self,
        bag: Path,
        *,
        compress: bool = True,
        say: Say = print,
        warn: Say = print,
        backlog_limit: int = BACKLOG_LIMIT,
    ) -> None:
        self.losses = LossCounter()
        self.dropped = 0
        self._writer = BagWriter(bag, compress=compress)
        self._say = say
        self._warn = warn
        self._backlog_limit = backlog_limit
        self._backlog = 0
        self._queue: queue.SimpleQueue[_Waiting | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._refused = False
        self._told_lost = 0
        self._thread = threading.Thread(target=self._work, name='recorder')
        self._thread.start()

    @property
    def message_count(self) -> int:
        """Number of messages taken so far."""
        return self._writer.message_count

    def add_topic(self, name: str, type_name: str, qos: TopicQos) -> None:
        """Announce a topic before its messages.

        Raises:
            InputError: the type is not installed, or the topic is known with another type.
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
        alone: bool = True,
    ) -> None:
        """Take a serialized message; `sequence` is its publisher's count, see LossCounter."""
        self.losses.see(topic, sequence, alone=alone)
        if self._backlog + len(data) > self._backlog_limit:
            self.dropped += 1
            return
        self._backlog += len(data)
        self._queue.put(_Waiting(topic, data, log_time, publish_time, sequence))

    def stop(self) -> None:
        """Write what waits, complete the bag, and say what became of the recording."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._queue.put(None)
        self._thread.join()
        with self._lock:
            try:
                self._writer.close()
            except OSError as error:
                self._warn(
                    f'{self._writer.path}: the end could not be written ({error.strerror}); '
                    'what was recorded before can be read all the same'
                )
        lost = self.losses.total + self.dropped
        self._say(
            f'{self._writer.path}: {self._writer.message_count} messages recorded, {lost} lost'
        )

    def _work(self) -> None:
        due = time.monotonic() + FLUSH_PERIOD
        while True:
            try:
                waiting = self._queue.get(timeout=max(0.0, due - time.monotonic()))
            except queue.Empty:
                waiting = _NOTHING
            if waiting is None or (self._refused and self._stopping.is_set()):
                self.dropped += 0 if waiting is None else 1 + self._queue.qsize()
                return
            try:
                if waiting is not _NOTHING:
                    self._write(waiting)
                if time.monotonic() >= due:
                    self._flush()
                    due = time.monotonic() + FLUSH_PERIOD
            except OSError as error:
                self._outlast(error)
            except Exception as error:
                # one message that cannot be written must not end the recording
                self.dropped += 1
                self._warn(f'{self._writer.path}: a message on {waiting.topic} is lost: {error!r}')

    def _write(self, message: _Waiting) -> None:
        self._backlog -= len(message.data)
        with self._lock:
            self._writer.write(
                message.topic,
                message.data,
                log_time=message.log_time,
                publish_time=message.publish_time,
                sequence=message.sequence,
            )

    def _flush(self) -> None:
        with self._lock:
            self._writer.flush()
        self._tell_losses()

    def _outlast(self, error: OSError) -> None:
        """Wait until the disk takes data again, or the recording is stopped."""
        self._refused = True
        self._warn(
            f'{self._writer.path}: the disk refuses more ({error.strerror}); free some space, '
            'recording goes on by itself'
        )
        while not self._stopping.wait(FLUSH_PERIOD):
            try:
                self._flush()
            except OSError:
                continue
            self._refused = False
            self._warn(f'{self._writer.path}: the disk takes data again, recording goes on')
            return

    def _tell_losses(self) -> None:
        lost = self.losses.total + self.dropped
        if lost > self._told_lost:
            worst = max(self.losses.lost, key=lambda topic: self.losses.lost[topic], default='')
            where = f', most on {worst}' if worst else ''
            self._warn(f'{lost - self._told_lost} messages lost{where}; {lost} in all')
            self._told_lost = lost
