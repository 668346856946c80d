"""Threads for the work of requests that may block, and how long all of them have been busy."""

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

WORKERS = 8
"""Threads of the page: maps are drawn in milliseconds, and a confirmation waits for an answer."""

Result = TypeVar('Result')


class Workers:
    """Runs functions in threads; `busy_for` tells whether requests wait for a free one."""

    def __init__(
        self, count: int = WORKERS, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Prepare `count` threads; `clock` returns a steady time [s]."""
        self.count = count
        self._threads = ThreadPoolExecutor(count, thread_name_prefix='page')
        self._clock = clock
        self._lock = threading.Lock()
        self._at_work = 0
        self._busy_since: float | None = None

    async def run(self, function: Callable[..., Result], *given: object) -> Result:
        """Return the result of `function` with the arguments `given`, computed in a thread."""
        return await asyncio.get_running_loop().run_in_executor(
            self._threads, self._work, function, given
        )

    @property
    def busy_for(self) -> float:
        """Time since which no thread has been free [s]; 0 if one is."""
        with self._lock:
            return 0.0 if self._busy_since is None else self._clock() - self._busy_since

    def _work(self, function: Callable[..., Result], given: tuple[object, ...]) -> Result:
        self._change(1)
        try:
            return function(*given)
        finally:
            self._change(-1)

    def _change(self, by: int) -> None:
        with self._lock:
            self._at_work += by
            if self._at_work < self.count:
                self._busy_since = None
            elif by > 0:
                self._busy_since = self._clock()
