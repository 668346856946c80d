"""The answers of a graph to the photographs of a replay, by their stamps."""

import threading
import time

from porotwin_core.clock.periods import POLL_S
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_recording.mcap.serialization import SECOND

SAME_STAMP = round(SAME_STAMP_S * SECOND)
"""Stamps that differ by less are the same [ns]: a node that computes with a stamp in seconds since
1970 rounds it by 120 ns."""

_NEVER = -(1 << 63)
"""Before all stamps [ns]."""


class LockStep:
    """Tells whether photographs were answered; threads may tell and wait at the same time."""

    def __init__(self) -> None:
        """Know of no photograph."""
        self._changed = threading.Condition()
        self._asked = _NEVER
        self._answered = _NEVER
        self._refused: dict[int, str] = {}

    def ask(self, stamp: int) -> None:
        """Note that the photograph with `stamp` [ns] will be published now.

        If time goes back, answers to the photographs before it do not count.
        """
        with self._changed:
            if stamp < self._asked:
                self._forget()
            self._asked = stamp

    def begin_anew(self) -> None:
        """Forget everything: the replay starts again."""
        with self._changed:
            self._forget()
            self._asked = _NEVER

    def _forget(self) -> None:
        self._answered = _NEVER
        self._refused.clear()

    def answer(self, stamp: int) -> None:
        """Note an answer with `stamp` [ns].

        One beyond the newest photograph comes late, from before time went back.
        """
        with self._changed:
            if stamp < self._asked + SAME_STAMP:
                self._answered = max(self._answered, stamp)
                self._changed.notify_all()

    def refuse(self, seconds: float, reason: str) -> None:
        """Note that nobody will answer the photograph at `seconds` [s], for a `reason`.

        Raises:
            ValueError, OverflowError: the time is not finite.
        """
        with self._changed:
            self._refused[_milliseconds(round(seconds * SECOND))] = reason
            self._changed.notify_all()

    def wait(self, stamp: int, timeout: float, stopping: threading.Event) -> str:
        """Wait for an answer with `stamp` [ns] or a later one; return why it is refused, or ''.

        Args:
            stamp: of the photograph [ns].
            timeout: longest wait [s].
            stopping: ends the wait.

        Raises:
            TimeoutError: there was no answer.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            while self._answered <= stamp - SAME_STAMP and not stopping.is_set():
                reason = self._refused.get(_milliseconds(stamp))
                if reason is not None:
                    return reason
                if not self._changed.wait(POLL_S) and time.monotonic() > deadline:
                    raise TimeoutError
        return ''


def _milliseconds(stamp: int) -> int:
    return round(stamp * 1000 / SECOND)
