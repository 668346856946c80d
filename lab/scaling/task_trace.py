"""The graph of the tasks that a piece of work hands to a crew, with measured durations.

The work runs once, one task after the other, with a `TraceCrew`. Its trace is a `Strand`: pieces of
work here, tasks away, and forks into further strands that are joined again.
"""

import pickle
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from porotwin_core.basis.parallel import Crew


@dataclass(frozen=True)
class Here:
    """Work [s] of the process that hands out the tasks."""

    seconds: float


@dataclass(frozen=True)
class Away:
    """A task that takes `seconds` in a worker; its arguments and result have `size` [B]."""

    seconds: float
    size: float = 0.0


@dataclass
class Strand:
    """Steps one after the other; a list of strands among them is a fork that is joined again."""

    steps: list['Here | Away | list[Strand]'] = field(default_factory=list)

    @property
    def tasks(self) -> int:
        """Number of tasks in this strand and its forks."""
        return sum(
            sum(strand.tasks for strand in step)
            if isinstance(step, list)
            else isinstance(step, Away)
            for step in self.steps
        )

    def seconds(self, kind: type[Here | Away]) -> float:
        """Return the sum [s] of one kind of work in this strand and its forks."""
        return sum(
            sum(strand.seconds(kind) for strand in step)
            if isinstance(step, list)
            else step.seconds * isinstance(step, kind)
            for step in self.steps
        )


class TraceCrew(Crew):
    """Does every task at once, and keeps the trace of the whole work.

    Attributes:
        trace: the trace so far; complete after `finish`.
    """

    workers = 1

    def __init__(self) -> None:
        """Begin the trace."""
        self.trace = Strand()
        self._now = self.trace
        self._since = time.perf_counter()

    def finish(self) -> Strand:
        """Return the trace, with the last work here."""
        self._add_work_here()
        return self.trace

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the finished future of `function(*args, **kwargs)`."""
        self._add_work_here()
        begin, future = time.perf_counter(), Future[Any]()
        result = function(*args, **kwargs)
        seconds = time.perf_counter() - begin
        future.set_result(result)
        size = len(pickle.dumps((args, kwargs, result)))
        self._now.steps.append(Away(seconds, float(size)))
        self._since = time.perf_counter()
        return future

    def threads(self, count: int) -> Executor:
        """Return an executor whose `map` is a fork of the trace."""
        del count
        return _Forks(self)

    @contextmanager
    def strand(self) -> Iterator[Strand]:
        """Trace into a strand of its own."""
        self._add_work_here()
        outer, self._now = self._now, Strand()
        try:
            yield self._now
        finally:
            self._add_work_here()
            self._now = outer

    def add_fork(self, strands: list[Strand]) -> None:
        """Add a fork to the present strand."""
        self._now.steps.append(strands)

    def _add_work_here(self) -> None:
        now = time.perf_counter()
        self._now.steps.append(Here(now - self._since))
        self._since = now


class _Forks(Executor):
    """Runs calls one after the other, as strands of a fork."""

    def __init__(self, crew: TraceCrew) -> None:
        self._crew = crew

    def map(  # type: ignore[override]
        self, function: Callable[..., Any], *iterables: Iterable[Any], **_: Any
    ) -> Iterator[Any]:
        """Return the results of `function`, made at once."""
        results, strands = [], []
        for items in zip(*iterables, strict=False):
            with self._crew.strand() as strand:
                results.append(function(*items))
            strands.append(strand)
        self._crew.add_fork(strands)
        return iter(results)
