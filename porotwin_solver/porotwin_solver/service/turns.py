"""Turns of several requests at one model: one works, a few wait, a client can cancel its own."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from porotwin_core.clock.periods import HEARTBEAT_S


class CancelledError(Exception):
    """The request was cancelled; its answer is of no use any more."""


class BusyError(Exception):
    """Too many requests wait already."""


@dataclass(eq=False)
class _Request:
    """A request that is here: the token of its client, and whether it goes on."""

    token: str = ''
    abandoned: Callable[[], bool] = lambda: False
    cancelled: bool = False


class Turns:
    """Lets one request at a time work. A cancelled request ends at the next `check`.

    A request that waits when `cancel` comes never begins: nobody waits for its answer. Whoever does
    not know the token of a request cannot cancel it.
    """

    def __init__(self, most_waiting: int) -> None:
        """Let at most `most_waiting` requests wait while another one works."""
        self._most = most_waiting + 1
        self._work = threading.Lock()
        self._change = threading.Lock()
        self._present: list[_Request] = []
        self._working = _Request()
        self._next_look = 0.0

    @contextmanager
    def turn(
        self, abandoned: Callable[[], bool] = lambda: False, *, token: str = ''
    ) -> Iterator[None]:
        """Wait for the turn of a request, and keep the others waiting inside the block.

        Args:
            abandoned: tells whether nobody waits for the answer any more; `check` asks it now and
                then.
            token: of the client; empty: nobody can cancel the request.

        Raises:
            BusyError: too many requests wait.
            CancelledError: the request was cancelled before its turn came.
        """
        request = _Request(token, abandoned)
        with self._change:
            if len(self._present) >= self._most:
                raise BusyError(f'busy: {len(self._present)} requests are here; ask again later')
            self._present.append(request)
        try:
            with self._work:
                self._working = request
                self._next_look = time.monotonic() + HEARTBEAT_S
                self.check()
                yield
        finally:
            with self._change:
                self._present.remove(request)

    def cancel(self, token: str) -> int:
        """Cancel the requests of the client with `token` that are here; return their number."""
        with self._change:
            found = [one for one in self._present if token and one.token == token]
            for request in found:
                request.cancelled = True
            return len(found)

    def check(self) -> None:
        """Return if the request that works shall go on; call it between two steps of the work.

        Raises:
            CancelledError: it was cancelled, or nobody waits for its answer.
        """
        if self._working.cancelled:
            raise CancelledError('cancelled')
        if time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + HEARTBEAT_S
            if self._working.abandoned():
                raise CancelledError('cancelled: nobody waits for the answer')
