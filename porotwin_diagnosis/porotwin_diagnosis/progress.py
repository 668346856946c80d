"""The progress of a diagnosis, and the time that it takes at most."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import count

Progress = Callable[[str, float], None]
"""Called with the name of the stage and its position in the work, 0 to 1."""

FIRST_TRIED, ALL_TRIED = 0.01, 0.08
"""Begin and end of the first try of the effects without a place, as positions."""

SINGLES_JUDGED, SEARCH_ENDED = 0.25, 0.92
"""Ends of the judged single effects and of the search, as positions. A quick search goes from the
first one to the second."""

MOST = {ALL_TRIED: 1.0, 0.15: 3.0, SINGLES_JUDGED: 6.0, 0.56: 30.0, SEARCH_ENDED: 25.0, 1.0: 3.0}
"""The most time of each stage by its last position: effects without a place, with one, judged
effects, pairs, triples, verdict. The first one is the unit. Measured on five recordings, on grids
of 187 x 112 to 280 x 150: at most 1.5 for the second, 4.0 for the third and 2.0 for the last. Pairs
and triples took 47 and 33 in an earlier search, and take 0.6 of the time now."""


class WorkClock:
    """The latest end of a diagnosis: it never becomes later unless the machine becomes slower.

    The first try of the effects without a place is the measure: all later stages take at most
    `MOST` of it, and many of them are left out. It is known when half of them were tried, the slow
    ones among them. A stage that takes longer than its most makes the measure longer.
    """

    def __init__(self, *, quick: bool = False, now: Callable[[], float] = time.monotonic) -> None:
        """Begin; a `quick` search ends when single effects are judged. `now` tells the time [s]."""
        left_out = [end for end in MOST if quick and SINGLES_JUDGED < end <= SEARCH_ENDED]
        self._most = {end: most for end, most in MOST.items() if end not in left_out}
        self._now, self._begin = now, now()
        self._position, self._stage, self._entered = 0.0, ALL_TRIED, self._begin
        self._measure = math.inf
        self._latest = {SINGLES_JUDGED: math.inf, max(MOST): math.inf}

    def reach(self, position: float) -> None:
        """Go on to `position`; an earlier one changes nothing."""
        stage = next((end for end in self._most if position < end), max(MOST))
        if stage > self._stage or self._position < FIRST_TRIED <= position:
            self._position = max(self._position, min(position, self._stage))
            self._look()
            self._stage, self._entered = max(stage, self._stage), self._now()
        self._position = max(self._position, position)
        self._look()

    @property
    def left(self) -> float:
        """The longest time to the end [s]; infinite if it is not known yet."""
        return self._until(max(MOST))

    @property
    def left_for_singles(self) -> float:
        """The longest time until every single effect is judged [s], as `left`."""
        return self._until(SINGLES_JUDGED)

    def _until(self, position: float) -> float:
        self._look()
        return max(self._latest[position] - self._now(), 0.0)

    @property
    def share(self) -> float:
        """Share of the time that has passed if nothing more is left out; 0 if it is not known."""
        elapsed = self._now() - self._begin
        return elapsed / (elapsed + self.left) if elapsed else 0.0

    def _look(self) -> None:
        """Tell the latest ends anew."""
        now = self._now()
        passed = now - self._entered
        slower = self._stage > ALL_TRIED and passed > self._measure * self._most[self._stage]
        if slower:
            self._measure = passed / self._most[self._stage]
        elif self._stage == ALL_TRIED:
            done = (self._position - FIRST_TRIED) / (ALL_TRIED - FIRST_TRIED)
            self._measure = passed / done if done > 0.5 else math.inf
        for until, latest in self._latest.items():
            most = sum(most for end, most in self._most.items() if self._stage <= end <= until)
            left = self._measure * most - passed if self._position < until else 0.0
            if now + left < latest or slower:
                self._latest[until] = max(now + left, now)


def steps_of(
    progress: Progress, begin: float, width: float, number: int
) -> Callable[[str], AbstractContextManager[None]]:
    """Return a context manager for each of `number` steps, which may run side by side.

    Steps count when they end. All of them together go from position `begin` on by `width`.
    """
    ended = count(1)
    reached = begin

    @contextmanager
    def step(stage: str) -> Iterator[None]:
        nonlocal reached
        progress(stage, reached)
        yield
        reached = max(reached, begin + width * next(ended) / number)
        progress(stage, reached)

    return step


def forward_only(progress: Progress) -> Progress:
    """Return `progress` with positions that never decrease.

    Some stages run more than once; the second run keeps the position that was reached.
    """
    reached = 0.0

    def report(stage: str, fraction: float) -> None:
        nonlocal reached
        reached = max(reached, fraction)
        progress(stage, reached)

    return report


def no_progress(_stage: str, _fraction: float) -> None:
    """Ignore the progress."""
