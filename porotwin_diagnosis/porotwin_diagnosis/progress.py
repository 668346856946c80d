"""Functions that report the progress of a diagnosis."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import count

import numpy as np

Progress = Callable[[str, float], None]
"""Called with the name of the stage and its position in the work, 0 to 1. `WorkClock` turns
positions into shares of time."""


POSITIONS = (
    0.0, 0.01, 0.08, 0.15, 0.25, 0.42, 0.476, 0.48, 0.53, 0.56, 0.64, 0.73, 0.78, 0.92, 0.95, 1.0,
)  # fmt: skip
SHARES = (
    0.0, 0.012, 0.023, 0.048, 0.07, 0.11, 0.2, 0.37, 0.53, 0.62, 0.69, 0.8, 0.88, 0.965, 0.975, 1.0,
)  # fmt: skip
"""Positions, and the measured share of time up to each, of a diagnosis that goes through all
stages: 560 s for six minutes of the small rig, on two cores."""

STAGE_ENDS = (0.25, 0.476, 0.48, 0.56, 0.78, 0.92)
"""Positions at which nothing more may be needed: after single effects, pairs, pairs fitted again,
pairs found in other ways, triples on coarse cells, and judged triples. What follows the last one is
done in any case."""

SINGLES_JUDGED = STAGE_ENDS[0]
"""Position at which every single effect is judged; a quick search ends there."""


class WorkClock:
    """Turns positions into shares of the work; work that is left out counts no longer."""

    def __init__(self, *, quick: bool = False) -> None:
        """Begin; a `quick` search ends when single effects are judged."""
        self._quick = quick
        self._position = 0.0
        self._done = 0.0

    def reach(self, position: float) -> None:
        """Go on to `position`; an earlier one changes nothing.

        Beyond the end of the present stage, what lies between was left out.
        """
        if position <= self._position:
            return
        self._done += share_of_time(min(position, self._stage_end)) - share_of_time(self._position)
        self._position = position

    @property
    def share(self) -> float:
        """Share of the work that is done, if nothing more is left out."""
        return self._done / (self._done + self._left)

    @property
    def least_left(self) -> float:
        """Share of the work that is left, if the search ends with the present stage."""
        finish = 1.0 - share_of_time(STAGE_ENDS[-1])
        stage = share_of_time(self._stage_end) - share_of_time(self._position)
        least = min(stage + finish, self._left)
        return least / (self._done + self._left)

    @property
    def _stage_end(self) -> float:
        """Position at which the present stage ends."""
        return next((end for end in STAGE_ENDS if self._position < end), 1.0)

    @property
    def _left(self) -> float:
        left = 1.0 - share_of_time(self._position)
        if self._quick and self._position < STAGE_ENDS[-1]:
            begin = share_of_time(max(self._position, SINGLES_JUDGED))
            left -= share_of_time(STAGE_ENDS[-1]) - begin
        return left


def share_of_time(position: float) -> float:
    """Return the share of time up to `position` if no stage is left out."""
    return float(np.interp(position, POSITIONS, SHARES))


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
