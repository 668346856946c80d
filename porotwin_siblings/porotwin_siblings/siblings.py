"""The siblings: they learn from every photograph, and tell what they expect, with bands."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, fill_unseen
from porotwin_core.rates_in_force import RatePeriod
from porotwin_core.rig import Rig
from porotwin_core.wells import RateStep
from porotwin_siblings.belief import Belief, standard_scores
from porotwin_siblings.course import Course, CourseOrder, run_course
from porotwin_siblings.diagnosed_effects import DiagnosedEffect
from porotwin_siblings.features import Blocks
from porotwin_siblings.rate_log import plan_periods
from porotwin_siblings.traits import Traits, Unknowns
from porotwin_siblings.zone_measure import ZoneMeasure

WINDOW_S = 900.0
"""Length of the course that a photograph is compared with [s]. Short: the plume has not moved far
enough to tell causes apart. Long: what no sibling knows has piled up."""

LEARNING_S = 150.0
"""Shortest time between two photographs that are learnt from [s]: the plume moves by less than a
block meanwhile, so that photographs in between tell little more."""

MEMORY_S = 7200.0
"""Time in which what was learnt fades by 1/e [s]: pumps and tubes change over hours."""

MODEL_DEVIATION = 0.02
"""Error of the mean of a block that no sibling knows a cause of [-]."""

RELATED_BLOCKS = 4.0
"""Blocks whose errors are alike: they count as one observation."""

USUAL_DEVIATION = 0.02
"""Deviation of a photograph that tells none, random and systematic each [-]."""

BAND = (0.05, 0.5, 0.95)
"""Quantiles of a forecast: the ends of the 90 % band and the median."""


class Photograph(NamedTuple):
    """A map from a photograph at `time` [s], on the grid of the siblings.

    `concentration` (nz, nx) [-], NaN where nothing was seen. `random` and `systematic` are the
    standard deviations of its error [-], (nz, nx): new in every photograph, and always the same.
    """

    time: float
    concentration: FloatArray
    random: FloatArray
    systematic: FloatArray

    @classmethod
    def plain(cls, time: float, concentration: FloatArray) -> 'Photograph':
        """Return a map (nz, nx) of unknown deviation."""
        usual = np.full(concentration.shape, USUAL_DEVIATION)
        return cls(time, concentration, usual, usual * np.nan_to_num(concentration))


@dataclass(frozen=True)
class Outlook:
    """What the siblings expect from `start` [s] on under a `plan` of rates over `horizon` [s].

    `times` [s] are after `start`. `zone_tracer` [m^3], `zone_area` [m^2] are (3, times): the ends
    of the 90 % band about the median, in the order of `BAND`. `zone_reached` (times,) is the share
    of siblings whose tracer has reached the zone by then. `mean` and `deviation` are the maps
    (map times, nz, nx) [-] at `map_times` [s] after `start`.
    """

    start: float
    plan: tuple[RateStep, ...]
    horizon: float
    times: FloatArray
    zone_tracer: FloatArray
    zone_area: FloatArray
    zone_reached: FloatArray
    map_times: FloatArray
    mean: FloatArray
    deviation: FloatArray


class _Moment(NamedTuple):
    """A state estimate (nz, nx), the systematic deviation of its photograph, and rates until the
    next one."""

    time: float
    state: FloatArray
    systematic: FloatArray
    periods: tuple[RatePeriod, ...]


class _Standing(NamedTuple):
    """Where all siblings stand: the newest state, and the traits of each."""

    begin: _Moment
    traits: tuple[Traits, ...]


class Siblings:
    """An ensemble of twins of one rig on one grid."""

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        executor: Executor,
        count: int = 32,
        diagnosed: Sequence[DiagnosedEffect] = (),
        seed: int = 1,
    ) -> None:
        """Make siblings that know nothing yet.

        Args:
            rig: the rig as described.
            grid: of the siblings.
            executor: runs their courses: threads, processes, or a Dask client's executor.
            count: number of siblings.
            diagnosed: effects that a diagnosis found.
            seed: of their differences.

        Raises:
            InputError: too few siblings, or an effect that the rig cannot have.
        """
        self.rig, self.grid = rig, grid
        self.unknowns = Unknowns.of(rig, diagnosed)
        self.zone = ZoneMeasure.of(rig, grid)
        self._executor = executor
        self._blocks = Blocks.of(grid)
        self._prior = Belief.independent(self.unknowns.mean, self.unknowns.deviation)
        self._scores = standard_scores(len(self.unknowns.listed), count, seed)
        self.belief = self._prior
        self._past: deque[_Moment] = deque()
        self._learnt = -math.inf
        self._newest: _Standing | None = None

    @property
    def started(self) -> bool:
        """Whether there is a state to start from."""
        return self._newest is not None

    @property
    def time(self) -> float:
        """Time of the newest state [s]."""
        return self._standing().begin.time

    @property
    def state(self) -> FloatArray:
        """The newest state estimate, (nz, nx) [-]."""
        return self._standing().begin.state

    def _standing(self) -> '_Standing':
        if self._newest is None:
            raise InputError('no photograph has come yet; ask again after the first one')
        return self._newest

    def interrupt(self) -> None:
        """Forget the states, and keep what was learnt of the rig."""
        self._past.clear()
        self._newest = None

    def begin_anew(self) -> None:
        """Forget everything."""
        self.interrupt()
        self.belief = self._prior

    def members(self) -> list[Traits]:
        """Return the traits of every sibling."""
        drawn = self.belief.members(self._scores)
        return [self.unknowns.traits(values) for values in drawn.T]

    def rate_factors(self) -> dict[str, tuple[float, float]]:
        """Return the rate factor of every well, and its standard deviation [-]."""
        result = {}
        for well in self.unknowns.wells:
            place = self.unknowns.index(f'rate {well}')
            factor = math.exp(self.belief.mean[place])
            result[well] = (factor, factor * float(self.belief.deviation[place]))
        return result

    def observe(self, photograph: Photograph, periods: Sequence[RatePeriod] = ()) -> None:
        """Learn from a photograph.

        Args:
            photograph: the newest one.
            periods: rates since the last photograph, consecutive; empty: it follows from none.

        Raises:
            InputError: a course cannot be run, for example with unbalanced rates.
        """
        if not periods:
            self.interrupt()
        expected = None
        if self._past:
            self._past[-1] = self._past[-1]._replace(periods=tuple(periods))
            if photograph.time - self._learnt >= LEARNING_S:
                self._learn(photograph)
            expected = self._expected(photograph.time)
        state = fill_unseen(photograph.concentration, expected)
        self._past.append(_Moment(photograph.time, state, photograph.systematic, ()))
        while photograph.time - self._past[0].time > WINDOW_S:
            self._past.popleft()
        if len(self._past) == 1:
            self._learnt = photograph.time
        self._newest = _Standing(self._past[-1], tuple(self.members()))

    def outlook(
        self,
        plan: Sequence[RateStep],
        horizon: float,
        times: Iterable[float],
        map_times: Iterable[float] = (),
        *,
        executor: Executor | None = None,
    ) -> Outlook:
        """Return what is expected from the newest state on; any thread may ask at any time.

        Args:
            plan: the rates as commanded; its times count from the newest state.
            horizon: how long [s].
            times: after the newest state [s], increasing.
            map_times: after the newest state [s], increasing; when maps are wanted.
            executor: runs the courses instead of the usual one.

        Raises:
            InputError: a course cannot be run.
        """
        after, maps_after = np.array(list(times)), np.array(list(map_times))
        begin, traits = self._standing()
        periods = plan_periods(plan, begin.time, horizon)
        courses = self._run(
            (self._order(begin, one, periods, after, maps_after) for one in traits), executor
        )
        tracer = np.array([course.zone_tracer for course in courses])
        area = np.array([course.zone_area for course in courses])
        maps = np.array([course.maps for course in courses])
        reached = np.maximum.accumulate(tracer, axis=1) > self.zone.reached_tracer
        return Outlook(
            begin.time,
            tuple(plan),
            horizon,
            after,
            np.quantile(tracer, BAND, axis=0),
            np.quantile(area, BAND, axis=0),
            reached.mean(axis=0),
            maps_after,
            maps.mean(axis=0),
            maps.std(axis=0),
        )

    def _run(self, orders: Iterable[CourseOrder], executor: Executor | None = None) -> list[Course]:
        return list((executor or self._executor).map(run_course, list(orders)))

    def _order(
        self,
        begin: _Moment,
        traits: Traits,
        periods: Sequence[RatePeriod],
        times: FloatArray,
        map_times: FloatArray,
    ) -> CourseOrder:
        """Return the order of a sibling's course from `begin`, with times [s] after it."""
        true_state = begin.state - traits.photograph_error * begin.systematic
        return CourseOrder(
            self.rig,
            self.grid,
            traits,
            np.clip(true_state, 0.0, 1.0),
            tuple(periods),
            self.zone if len(times) else None,
            tuple(float(begin.time + time) for time in times),
            tuple(float(begin.time + time) for time in map_times),
        )

    def _expected(self, time: float) -> FloatArray:
        """Return the map (nz, nx) that the mean of all beliefs expects at `time` [s]."""
        last = self._past[-1]
        traits = self.unknowns.traits(self.belief.mean)
        order = self._order(last, traits, last.periods, np.empty(0), np.array([time - last.time]))
        (course,) = self._run([order])
        return course.maps[0] + traits.photograph_error * last.systematic

    def _learn(self, photograph: Photograph) -> None:
        """Update the belief by how well each sibling expected `photograph` from a window ago."""
        begin = self._past[0]
        length = photograph.time - begin.time
        elapsed = photograph.time - self._learnt
        self._learnt = photograph.time
        self.belief = self.belief.relaxed(self._prior, 1.0 - math.exp(-elapsed / MEMORY_S))
        periods = [period for moment in self._past for period in moment.periods]
        traits = self.members()
        courses = self._run(
            self._order(begin, one, periods, np.empty(0), np.array([length])) for one in traits
        )
        seen = np.isfinite(photograph.concentration)
        expected = np.array(
            [
                course.maps[0] + one.photograph_error * photograph.systematic
                for course, one in zip(courses, traits, strict=True)
            ]
        )
        blocks = self._blocks
        predicted = blocks.means(expected, seen).T
        observed = blocks.means(photograph.concentration, seen)
        noise = blocks.means(photograph.random**2, seen)
        # photographs of one window judge nearly the same course: together they count as one
        alike = RELATED_BLOCKS * max(1.0, length / elapsed)
        variance = alike * (noise + MODEL_DEVIATION**2)
        self.belief = self.belief.updated(self._scores, predicted, observed, variance)
