"""Simulations of a search that somebody may end: its answer so far is then wanted.

A fit asks for many simulations, and a stage makes many fits side by side. So the wish is heard
before every simulation, and those that wait for a worker are cancelled.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from typing import Any
from weakref import WeakSet

from porotwin_core.basis.parallel import Crew


class EndableCrew(Crew):
    """A crew that ends its simulations with `CancelledError` while a search goes on."""

    def __init__(self, crew: Executor | None, ended: Callable[[], bool]) -> None:
        """Use `crew`, or the thread that asks without one, until `ended` returns true."""
        self._crew, self._ended = crew, ended
        self._waiting: WeakSet[Future[Any]] = WeakSet()
        self._searching = False
        self.workers = getattr(crew, 'workers', 1)

    @contextmanager
    def search(self) -> Iterator[None]:
        """Let the block be ended; what follows it, such as the verdict, makes all simulations."""
        self._searching = True
        try:
            yield
        except CancelledError:
            if not self._ended():
                raise
        finally:
            self._searching = False

    def threads(self, count: int) -> Executor:
        """Return `count` threads here for work that waits for tasks of this crew."""
        if isinstance(self._crew, Crew):
            return self._crew.threads(count)
        return super().threads(count)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of a simulation `function(*args, **kwargs)`.

        Raises:
            CancelledError: the search shall end.
        """
        if self._searching and self._ended():
            for one in list(self._waiting):
                one.cancel()
            raise CancelledError
        if self._crew is not None:
            future = self._crew.submit(function, *args, **kwargs)
            self._waiting.add(future)
            return future
        future = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
