"""The siblings: they learn from every photograph, and tell their expectations, with bands."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from porotwin_core.cost_term import CostTerm
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.map_blocks import Blocks
from porotwin_core.rates_in_force import RatePeriod, injected_tracer
from porotwin_core.rig import Rig
from porotwin_core.state_filter import Estimate, Seen, StateFilter
from porotwin_core.wells import RateStep
from porotwin_siblings.belief import Belief, standard_scores
from porotwin_siblings.course import Course, CourseOrder, run_course
from porotwin_siblings.diagnosed_effects import DiagnosedEffect
from porotwin_siblings.expected_cost import CostOrder
from porotwin_siblings.rate_log import plan_periods
from porotwin_siblings.traits import Traits, Unknowns
from porotwin_siblings.zone_measure import ZoneMeasure

WINDOW_S = 900.0
"""Length of the course that a photograph is compared with [s]. Short: the plume has not moved far
enough to tell causes apart. Long: unknown causes have piled up."""

LEARNING_S = 150.0
"""Shortest time between two photographs that are learnt from [s]: the plume moves by less than a
block meanwhile, so that photographs in between tell little more."""

MEMORY_S = 7200.0
"""Time in which earlier photographs fade by 1/e [s]: pumps and tubes change over hours."""

MODEL_DEVIATION = 0.02
"""Error of the mean of a block that no sibling knows a cause of [-]."""

FEATURE_FLOOR = 0.005
"""Difference of the mean of a block that means nothing [-]."""

INFLATION_SHARE = 0.5
"""Weight of a new photograph in the inflation of the spread."""

LEAST_INFLATION, MOST_INFLATION = 1.0, 4.0
"""Range of the inflation: the belief itself, and as far as the effects stay linear."""

RELATED_BLOCKS = 4.0
"""Blocks whose errors are alike: they count as one observation."""

USUAL_DEVIATION = 0.02
"""Deviation of a photograph that tells none, random and systematic each [-]."""

BAND = (0.05, 0.5, 0.95)
"""Quantiles of a forecast: the ends of the 90 % band and the median."""


class Photograph(NamedTuple):
    """A map from a photograph at `time` [s], on the grid of the maps.

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
    """The expectations from `start` [s] on under a `plan` of rates over `horizon` [s].

    `times` [s] are after `start`. `zone_tracer` [m^3], `zone_area` [m^2] are (3, times): the ends
    of the 90 % band about the median, in the order of `BAND`. `zone_reached` (times,) is the share
    of siblings whose tracer has reached the zone by then. All three are NaN without a zone. `mean`
    and `deviation` are the maps (map times, nz, nx) [-] at `map_times` [s] after `start`. `ranked`
    are the numbers of the siblings in the order of their tracer in the zone, summed over all times.
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
    ranked: tuple[int, ...]


class _Moment(NamedTuple):
    """A state estimate, the systematic deviation of its photograph (nz, nx), and rates until the
    next one."""

    time: float
    estimate: Estimate
    systematic: FloatArray
    periods: tuple[RatePeriod, ...]

    @property
    def state(self) -> FloatArray:
        """The estimate's concentration as a photograph shows it, (nz, nx) [-]."""
        return self.estimate.concentration


class _Standing(NamedTuple):
    """Where all siblings stand: the newest state, and the traits of each and of their mean."""

    begin: _Moment
    traits: tuple[Traits, ...]
    mean: Traits


class Siblings:
    """An ensemble of twins of one rig on one grid."""

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        executor: Executor,
        map_grid: Grid | None = None,
        count: int = 32,
        diagnosed: Sequence[DiagnosedEffect] = (),
        seed: int = 1,
    ) -> None:
        """Make siblings that know nothing yet.

        Args:
            rig: the rig as described.
            grid: of the siblings.
            executor: runs their courses: threads, processes, or a Dask client's executor.
            map_grid: of the photographs' maps, which is no coarser; None: the same.
            count: number of siblings.
            diagnosed: effects that a diagnosis found.
            seed: of their differences.

        Raises:
            InputError: too few siblings, or an effect that the rig cannot have.
        """
        map_grid = map_grid or grid
        self.rig, self.grid, self.map_grid = rig, grid, map_grid
        self.unknowns = Unknowns.of(rig, diagnosed)
        self._zones = {one: ZoneMeasure.of(rig, one) for one in (grid, map_grid)}
        self._pores = rig.cell_pore_volume(map_grid)
        self._executor = executor
        self._blocks = Blocks.of(grid)
        self._prior = Belief.independent(self.unknowns.mean, self.unknowns.deviation)
        self._scores = standard_scores(len(self.unknowns.listed), count, seed)
        self.belief = self._prior
        self.inflation = 1.0
        self._past: deque[_Moment] = deque()
        self._learnt = -math.inf
        self._filter = self._new_filter()
        self._newest: _Standing | None = None

    def _new_filter(self) -> StateFilter:
        return StateFilter(self._pores, (self.map_grid.dz, self.map_grid.dx))

    @property
    def zone(self) -> ZoneMeasure:
        """The measures of the zone on the grid of the maps."""
        return self._zones[self.map_grid]

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
        """The newest state estimate as a photograph shows it, (nz, nx) of the maps [-]."""
        return self._standing().begin.state

    def _standing(self) -> '_Standing':
        if self._newest is None:
            raise InputError('no photograph has come yet; ask again after the first one')
        return self._newest

    def interrupt(self) -> None:
        """Forget the states, and keep the belief about the rig."""
        self._past.clear()
        self._newest = None

    def begin_anew(self) -> None:
        """Forget everything."""
        self.interrupt()
        self.belief = self._prior
        self.inflation = 1.0
        self._filter = self._new_filter()

    def members(self) -> list[Traits]:
        """Return the traits of every sibling."""
        drawn = self.belief.members(self.inflation * self._scores)
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
        # the estimate is in terms of photographs: each sibling believes in another scale
        seen = Seen(
            photograph.concentration, photograph.random, np.zeros(photograph.concentration.shape)
        )
        if self._past:
            last = self._past[-1] = self._past[-1]._replace(periods=tuple(periods))
            if photograph.time - self._learnt >= LEARNING_S:
                self._learn(photograph)
            injected = injected_tracer(periods)
            estimate = self._filter.update(
                last.estimate, self._expected(photograph.time), seen, injected
            )
        else:
            estimate = self._filter.begin(seen)
        self._past.append(_Moment(photograph.time, estimate, photograph.systematic, ()))
        while photograph.time - self._past[0].time > WINDOW_S:
            self._past.popleft()
        if len(self._past) == 1:
            self._learnt = photograph.time
        self._newest = _Standing(self._past[-1], tuple(self.members()), self._mean())

    def outlook(
        self,
        plan: Sequence[RateStep],
        horizon: float,
        times: Iterable[float],
        map_times: Iterable[float] = (),
        *,
        executor: Executor | None = None,
    ) -> Outlook:
        """Return the expectations from the newest state on; any thread may ask at any time.

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
        begin, traits, mean = self._standing()
        periods = plan_periods(plan, begin.time, horizon)
        # the mean of all, on both grids, shows the smear of the coarse grid
        fine, coarse, *courses = self._run(
            [
                self._order(begin, mean, periods, after, np.empty(0), self.map_grid),
                self._order(begin, mean, periods, after, np.empty(0)),
                *(self._order(begin, one, periods, after, maps_after) for one in traits),
            ],
            executor,
        )
        tracer = np.array([course.zone_tracer for course in courses])
        tracer = np.maximum(tracer + fine.zone_tracer - coarse.zone_tracer, 0.0)
        area = np.array([course.zone_area for course in courses])
        area = np.maximum(area + fine.zone_area - coarse.zone_area, 0.0)
        maps = np.array([course.maps for course in courses])
        reached = np.maximum.accumulate(tracer, axis=1) > self.zone.reached_tracer
        reached_share = reached.mean(axis=0) if self.zone.known else np.full(len(after), np.nan)
        return Outlook(
            begin.time,
            tuple(plan),
            horizon,
            after,
            np.quantile(tracer, BAND, axis=0),
            np.quantile(area, BAND, axis=0),
            reached_share,
            maps_after,
            maps.mean(axis=0),
            maps.std(axis=0),
            tuple(int(number) for number in np.argsort(tracer.sum(axis=1), kind='stable')),
        )

    def cost_orders(
        self,
        numbers: Sequence[int],
        initial: FloatArray,
        plan: Sequence[RateStep],
        *,
        horizon: float,
        terms: Sequence[CostTerm],
        with_gradient: bool,
    ) -> list[CostOrder]:
        """Return the orders for the siblings with `numbers` to judge a plan.

        The rates of the plan are those that the pumps are believed to deliver; each sibling
        believes in others around them. The other arguments are as in `schedule_cost`, with maps
        (nz, nx) on any grid of the rig.

        Raises:
            InputError: no photograph has come yet.
        """
        standing = self._standing()
        usual = standing.mean.rate_factors
        nz, nx = initial.shape
        return [
            CostOrder(
                self.rig,
                self.rig.grid(nx, nz),
                one,
                {well: factor / usual[well] for well, factor in one.rate_factors.items()},
                initial,
                tuple(plan),
                horizon,
                tuple(terms),
                with_gradient,
            )
            for one in (standing.traits[number] for number in numbers)
        ]

    def _run(self, orders: Iterable[CourseOrder], executor: Executor | None = None) -> list[Course]:
        return list((executor or self._executor).map(run_course, list(orders)))

    def _order(
        self,
        begin: _Moment,
        traits: Traits,
        periods: Sequence[RatePeriod],
        times: FloatArray,
        map_times: FloatArray,
        grid: Grid | None = None,
    ) -> CourseOrder:
        """Return the order of a sibling's course from `begin`, with times [s] after it."""
        grid = grid or self.grid
        true_state = begin.state - traits.photograph_error * begin.systematic
        return CourseOrder(
            self.rig,
            grid,
            traits,
            conservative_resample(np.clip(true_state, 0.0, 1.0), grid.shape),
            tuple(periods),
            self._zones[grid] if len(times) else None,
            tuple(float(begin.time + time) for time in times),
            tuple(float(begin.time + time) for time in map_times),
        )

    def _mean(self) -> Traits:
        return self.unknowns.traits(self.belief.mean)

    def _expected(self, time: float) -> FloatArray:
        """Return the map (nz, nx) that a photograph at `time` [s] would show by the mean belief."""
        last, traits = self._past[-1], self._mean()
        after = np.array([time - last.time])
        order = self._order(last, traits, last.periods, np.empty(0), after, self.map_grid)
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
        shape = self.grid.shape
        map_, random, systematic = (
            conservative_resample(values, shape)
            for values in (
                photograph.concentration,
                photograph.random**2,
                photograph.systematic,
            )
        )
        seen = np.isfinite(map_)
        expected = np.array(
            [
                course.maps[0] + one.photograph_error * systematic
                for course, one in zip(courses, traits, strict=True)
            ]
        )
        blocks = self._blocks
        predicted = blocks.means(expected, seen).T
        observed = blocks.means(map_, seen)
        noise = blocks.means(random, seen)
        # photographs of one window judge nearly the same course: together they count as one
        alike = RELATED_BLOCKS * max(1.0, length / elapsed)
        variance = alike * (noise + MODEL_DEVIATION**2)
        self.belief = self.belief.updated(
            self.inflation * self._scores, predicted, observed, variance
        )
        self._inflate(predicted, observed, noise)

    def _inflate(self, predicted: FloatArray, observed: FloatArray, noise: FloatArray) -> None:
        """Spread the siblings by the distance of the photograph from their expectations.

        A cause that no sibling knows shows as a difference larger than their spread (adaptive
        inflation; Anderson, Tellus A 61 (2009) 72-83).
        """
        missed = float(np.sum((observed - predicted.mean(axis=1)) ** 2))
        spread = float(np.sum(predicted.var(axis=1) + noise + FEATURE_FLOOR**2))
        wanted = self.inflation * math.sqrt(missed / spread)
        moved = self.inflation + INFLATION_SHARE * (wanted - self.inflation)
        self.inflation = min(max(moved, LEAST_INFLATION), MOST_INFLATION)
