"""Turns of several requests at one model: one works, a few wait, and all can be cancelled."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LOOK_PERIOD_S = 1.0
"""Time between two looks whether anybody still waits for the answer [s]."""


class CancelledError(Exception):
    """The request was cancelled; its answer is of no use any more."""


class BusyError(Exception):
    """Too many requests wait already."""


class Turns:
    """Lets one request at a time work. A cancelled request ends at the next `check`.

    A request that waits when `cancel` comes never begins: nobody waits for its answer.
    """

    def __init__(self, most_waiting: int) -> None:
        """Let at most `most_waiting` requests wait while another one works."""
        self._most = most_waiting + 1
        self._work = threading.Lock()
        self._count = threading.Lock()
        self._present = 0
        self._cancellations = 0
        self._working_since_cancellation = 0
        self._abandoned: Callable[[], bool] = lambda: False
        self._next_look = 0.0

    @contextmanager
    def turn(self, abandoned: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Wait for the turn of a request, and keep the others waiting inside the block.

        `abandoned` tells whether nobody waits for the answer any more; `check` asks it now and
        then.

        Raises:
            BusyError: too many requests wait.
            CancelledError: all requests were cancelled before the turn came.
        """
        with self._count:
            if self._present >= self._most:
                raise BusyError(f'busy: {self._present} requests are here; ask again later')
            self._present += 1
            arrived = self._cancellations
        try:
            with self._work:
                self._working_since_cancellation = arrived
                self._abandoned = abandoned
                self._next_look = time.monotonic() + LOOK_PERIOD_S
                self.check()
                yield
        finally:
            with self._count:
                self._present -= 1

    def cancel(self) -> int:
        """Cancel all requests that are here, and return their number."""
        with self._count:
            self._cancellations += 1
            return self._present

    def check(self) -> None:
        """Return if the request that works shall go on; call it between two steps of the work.

        Raises:
            CancelledError: it was cancelled, or nobody waits for its answer.
        """
        if self._working_since_cancellation != self._cancellations:
            raise CancelledError('cancelled')
        if time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + LOOK_PERIOD_S
            if self._abandoned():
                raise CancelledError('cancelled: nobody waits for the answer')
