"""The health of one node: its last report, its work in progress, and stuck work."""

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

CALLBACK_PATIENCE_S = 10.0
"""Longest time that callbacks may wait for each other before the health says so [s].

Most callbacks only store a message. A callback that computes, such as a prediction, may take longer
and is no fault.
"""


@dataclass(frozen=True)
class HealthReport:
    """One report of a node about itself.

    Attributes:
        level: 0 good, 1 warning, 2 error, as in diagnostic_msgs/DiagnosticStatus.
        message: one line.
        time: when, on a steady clock [s].
        values: numbers and texts by name.
    """

    level: int
    message: str
    time: float
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Work:
    what: str
    start: float
    longest_s: float


class NodeHealth:
    """Keeps the last report and the work in progress; any thread may call it."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin with the report that the node runs; `clock` returns a steady time [s]."""
        self._clock = clock
        self._lock = threading.Lock()
        self._last = HealthReport(0, 'running', clock())
        self._works: dict[int, _Work] = {}
        self._works_begun = 0
        self._callbacks_ran = clock()

    def report(self, level: int, message: str, values: Mapping[str, str]) -> None:
        """Keep a report; it holds until the next one."""
        with self._lock:
            self._last = HealthReport(level, message, self._clock(), values)

    @contextmanager
    def busy(self, what: str, longest_s: float = math.inf) -> Iterator[None]:
        """Mark a piece of work as in progress.

        Args:
            what: the work in a few words, such as 'state 12'.
            longest_s: the work counts as stuck if it takes longer [s]; infinite: never.
        """
        with self._lock:
            self._works_begun += 1
            number = self._works_begun
            self._works[number] = _Work(what, self._clock(), longest_s)
        try:
            yield
        finally:
            with self._lock:
                del self._works[number]

    def callbacks_ran(self) -> None:
        """Note that a callback ran, so no other callback of its group blocks."""
        with self._lock:
            self._callbacks_ran = self._clock()

    def now(self) -> HealthReport:
        """Return the last report with its age, and all work that takes too long now.

        Stuck work is an error. Callbacks that wait are a warning, because one of them may compute.
        """
        with self._lock:
            last, works = self._last, list(self._works.values())
            moment = self._clock()
            waiting = moment - self._callbacks_ran
        level, remarks = last.level, []
        values = {**last.values, 'report_age_s': f'{moment - last.time:.1f}'}
        for work in works:
            values['busy_with'] = work.what
            values['busy_s'] = f'{moment - work.start:.1f}'
            if moment - work.start > work.longest_s:
                level = 2
                remarks.append(
                    f'{work.what}: at work for {moment - work.start:.0f} s, '
                    f'at most {work.longest_s:g} s were expected'
                )
        if waiting > CALLBACK_PATIENCE_S:
            level = max(level, 1)
            values['callbacks_wait_s'] = f'{waiting:.1f}'
            remarks.append(f'callbacks wait for {waiting:.0f} s: one of them is at work')
        message = '; '.join([*remarks, last.message])
        return HealthReport(level, message, moment, values)
