"""How the levels of water at the sand change over time, beside the rates of the wells."""

import bisect
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from porotwin_core.basis.units import MINUTE_S
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.rig import Rig


@dataclass(frozen=True)
class Rises:
    """Straight lines through `rises` [m] above the described level, at `times` [s].

    It begins anew after every `period` [s].
    """

    times: tuple[float, ...]
    rises: tuple[float, ...]
    period: float = math.inf

    @cached_property
    def edges(self) -> tuple[float, ...]:
        """Times [s] of one cycle between which the level counts as constant: minutes, and points.

        With the mean level of each part, every part lets through the water that the lines do.
        """
        found = []
        for (start, low), (end, high) in itertools.pairwise(
            zip(self.times, self.rises, strict=True)
        ):
            parts = math.ceil((end - start) / MINUTE_S) if high != low else 1
            found += np.linspace(start, end, parts + 1).tolist()
        return tuple(dict.fromkeys(found))

    def at(self, time: float) -> float:
        """Return the rise [m] at `time` [s], which is no time of a step."""
        within = math.fmod(time, self.period) if time > 0.0 else 0.0
        return float(np.interp(within, self.times, self.rises))


@dataclass(frozen=True)
class WaterLevels:
    """The levels that change, by the name of the water.

    Attributes:
        courses: the rises above the described levels, from the start of the experiment on.
        began: the start of the experiment [s].
    """

    courses: Mapping[str, Rises] = field(default_factory=dict)
    began: float = 0.0

    @classmethod
    def of(cls, rig: Rig) -> 'WaterLevels':
        """Return the levels of `rig`, in seconds since the start of the experiment."""
        found = {}
        for name, course in rig.levels.items():
            head = rig.water_bodies[name].head_m
            assert head is not None
            minutes, levels = zip((0.0, head), *course.points, strict=True)
            every = math.inf if course.every_min is None else MINUTE_S * course.every_min
            times = tuple(MINUTE_S * minute for minute in minutes)
            found[name] = Rises(times, tuple(level - head for level in levels), every)
        return cls(found)

    def since(self, began: float) -> 'WaterLevels':
        """Return the levels on a clock that showed `began` [s] at the start of the experiment."""
        return replace(self, began=began)

    def moments(self, begin: float, end: float) -> list[float]:
        """Return the times [s] in their order that divide `begin` to `end` [s], both left out."""
        first, last = (time - self.began for time in (begin, end))
        found: set[float] = set()
        for course in self.courses.values():
            edges = course.edges
            if math.isinf(course.period):
                starts: Sequence[float] = (0.0,)
            else:
                cycles = range(int(max(first, 0.0) / course.period), int(last / course.period) + 1)
                starts = [number * course.period for number in cycles]
            for start in starts:
                low = bisect.bisect_right(edges, first - start)
                high = bisect.bisect_left(edges, last - start)
                found.update(start + edge for edge in edges[low:high])
        return sorted(self.began + time for time in found)

    def parts(self, begin: float, end: float) -> Iterator[tuple[float, float, dict[str, float]]]:
        """Yield (start, end, rises) of the parts of `begin` to `end` [s], which is finite.

        Each names all water whose level changes, at its mean level.
        """
        edges = [
            time
            for time in self.moments(begin, end)
            if begin + SAME_STAMP_S < time < end - SAME_STAMP_S
        ]
        for low, high in itertools.pairwise([begin, *edges, end]):
            yield low, high, self.mean(low, high)

    def at(self, time: float) -> dict[str, float]:
        """Return how much higher each water stands at `time` [s] than described [m], by name."""
        return {name: course.at(time - self.began) for name, course in self.courses.items()}

    def mean(self, begin: float, end: float) -> dict[str, float]:
        """Return as `at` in the middle of `begin` to `end` [s]: the mean of straight lines."""
        first = max(begin, self.began)  # before, all stand as described
        return self.at(first + (end - first) / 2.0)


NO_LEVELS = WaterLevels()
"""No level changes."""
