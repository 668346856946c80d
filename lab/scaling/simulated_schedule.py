"""How long a traced piece of work would take on any number of workers.

The durations are measured, the scheduling is simulated: first come, first served. The process that
hands out the tasks is one Python interpreter, so it does one thing at a time. It also packs every
task and takes every result through one network cable.
"""

import heapq
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count

from lab.scaling.task_trace import Away, Here, Strand

HANDING_S = 1e-3
"""Work of the process and of the scheduler for each task [s]; Dask's manual tells about as much."""

LATENCY_S = 5e-3
"""Time for a task to reach its worker, and for the answer to come back [s]."""

NETWORK_B_S = 1.1e8
"""Speed of a cable with 1 Gbit/s [B/s]."""


@dataclass
class _Resource:
    """Places for work, and a queue."""

    places: int
    waiting: deque[tuple[float, Callable[[], None]]] = field(default_factory=deque)


class _Schedule:
    """Events in the order of their times."""

    def __init__(self, workers: int) -> None:
        self.now = 0.0
        self.interpreter, self.workers = _Resource(1), _Resource(workers)
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()

    def after(self, seconds: float, then: Callable[[], None]) -> None:
        heapq.heappush(self._events, (self.now + seconds, next(self._number), then))

    def use(self, resource: _Resource, seconds: float, then: Callable[[], None]) -> None:
        """Hold a place of `resource` for `seconds`, as soon as one is free."""
        if resource.places == 0:
            resource.waiting.append((seconds, then))
            return
        resource.places -= 1

        def done() -> None:
            resource.places += 1
            if resource.waiting:
                self.use(resource, *resource.waiting.popleft())
            then()

        self.after(seconds, done)

    def run(self) -> float:
        """Return the time of the last event [s]."""
        while self._events:
            self.now, _, then = heapq.heappop(self._events)
            then()
        return self.now

    def follow(self, strand: Strand, then: Callable[[], None], at: int = 0) -> None:
        """Do the steps of `strand` from number `at` on."""
        if at == len(strand.steps):
            then()
            return
        step = strand.steps[at]

        def onward() -> None:
            self.follow(strand, then, at + 1)

        if isinstance(step, Here):
            self.use(self.interpreter, step.seconds, onward)
        elif isinstance(step, Away):
            self._away(step, onward)
        else:
            self._fork(step, onward)

    def _away(self, task: Away, then: Callable[[], None]) -> None:
        def handed() -> None:
            self.use(self.workers, LATENCY_S + task.seconds, then)

        self.use(self.interpreter, HANDING_S + task.size / NETWORK_B_S, handed)

    def _fork(self, strands: list[Strand], then: Callable[[], None]) -> None:
        left = len(strands)

        def joined() -> None:
            nonlocal left
            left -= 1
            if left == 0:
                then()

        if not strands:
            then()
        for strand in strands:
            self.follow(strand, joined)


def simulated_seconds(strand: Strand, workers: int) -> float:
    """Return how long the work of `strand` would take with `workers` workers [s]."""
    schedule = _Schedule(workers)
    schedule.follow(strand, lambda: None)
    return schedule.run()


def handing_seconds(strand: Strand) -> float:
    """Return the work of the process that hands out the tasks, with its network cable [s]."""
    return sum(_handing(step) for step in strand.steps)


def _handing(step: Here | Away | list[Strand]) -> float:
    if isinstance(step, list):
        return sum(handing_seconds(strand) for strand in step)
    return step.seconds if isinstance(step, Here) else HANDING_S + step.size / NETWORK_B_S


def longest_chain(strand: Strand) -> float:
    """Return the time that no number of workers can shorten [s]: steps that wait for each other."""
    return sum(
        max((longest_chain(branch) for branch in step), default=0.0)
        if isinstance(step, list)
        else step.seconds
        for step in strand.steps
    )
