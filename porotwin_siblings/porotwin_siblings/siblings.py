"""The siblings: they learn from every photograph, and tell their expectations, with bands."""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from itertools import repeat
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.state_filter import Estimate, Seen, StateFilter
from porotwin_core.rates.delivered_rates import WINDOW_S, PumpFactor, delivered
from porotwin_core.rates.rate_periods import RatePeriod, injected_tracer, plan_periods
from porotwin_core.rates.wells import RateStep
from porotwin_core.rig import Rig
from porotwin_siblings.course import Course, CourseOrder, run_course
from porotwin_siblings.expected_cost import CostOrder
from porotwin_siblings.forecast_check import (
    CHECK_S,
    LEAST_AREA,
    LEAST_TRACER,
    USUAL_AREA,
    USUAL_TRACER,
    ForecastCheck,
)
from porotwin_siblings.front_check import FrontCheck, front_miss, widened
from porotwin_siblings.learning import Learning
from porotwin_siblings.outlook import BAND, Outlook
from porotwin_siblings.photograph import Photograph
from porotwin_siblings.unknowns import Sibling, Unknowns, drawn
from porotwin_siblings.zone_measure import ZoneMeasure
from porotwin_solver.effects import tracer_storage
from porotwin_solver.effects.definition.candidate import Candidate

LEARNING_S = 150.0
"""Shortest time between two photographs that are learnt from [s]: the plume moves by less than a
block meanwhile, so that photographs in between tell little more."""


NO_PUMPS: Mapping[str, PumpFactor] = {}
"""The hub has told nothing about pumps."""


class _Moment(NamedTuple):
    """A state estimate, the systematic deviation of its photograph (nz, nx), the sibling with the
    mean belief, and rates until the next photograph."""

    time: float
    estimate: Estimate
    systematic: FloatArray
    mean: Sibling
    periods: tuple[RatePeriod, ...]

    @property
    def state(self) -> FloatArray:
        """The estimate's concentration as a photograph shows it, (nz, nx) [-]."""
        return self.estimate.concentration


class _Standing(NamedTuple):
    """The newest state of all siblings, the beliefs of each, and the parts of the rate factors that
    meters tell, by well."""

    begin: _Moment
    members: tuple[Sibling, ...]
    metered: Mapping[str, float]


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
        diagnosed: Sequence[Candidate] = (),
    ) -> None:
        """Make siblings that know nothing yet.

        Args:
            rig: the rig as described.
            grid: of the siblings.
            executor: runs their courses: threads, processes, or a Dask client's executor.
            map_grid: of the photographs' maps, which is no coarser; None: the same.
            count: number of siblings.
            diagnosed: effects that a diagnosis found.

        Raises:
            InputError: too few siblings, or an effect that the rig cannot have.
        """
        map_grid = map_grid or grid
        self.rig, self.grid, self.map_grid = rig, grid, map_grid
        self.unknowns = Unknowns.of(rig, diagnosed)
        self._zones = {one: ZoneMeasure.of(rig, one) for one in (grid, map_grid)}
        mended = rig.with_effects(drawn(one, repeat(0.0)) for one in diagnosed)
        self._pores = tracer_storage(mended, map_grid)
        self._executor = executor
        self.learning = Learning(self.unknowns, grid, count)
        self._past: deque[_Moment] = deque()
        self._learnt = -math.inf
        self._newest: _Standing | None = None
        self._check_anew()

    def _check_anew(self) -> None:
        self.area_check = ForecastCheck(USUAL_AREA, LEAST_AREA)
        self.tracer_check = ForecastCheck(USUAL_TRACER, LEAST_TRACER)
        self.front_check = FrontCheck()
        self._filter = StateFilter(self._pores, (self.map_grid.dz, self.map_grid.dx))

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
        self.learning.begin_anew()
        self._check_anew()

    def observe(
        self,
        photograph: Photograph,
        periods: Sequence[RatePeriod] = (),
        pumps: Mapping[str, PumpFactor] = NO_PUMPS,
    ) -> None:
        """Learn from a photograph.

        Args:
            photograph: the newest one.
            periods: rates since the last photograph, consecutive; empty: it follows from none.
            pumps: the belief of the hub, by well; the siblings learn nothing about pumps.

        Raises:
            InputError: nothing can be learnt from the photograph, or a course cannot be run, for
                example with unbalanced rates.
        """
        photograph.check()
        self.learning.believe(pumps)
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
        mean = self.learning.mean()
        self._past.append(_Moment(photograph.time, estimate, photograph.systematic, mean, ()))
        self._check_forecast()
        while photograph.time - self._past[0].time > WINDOW_S:
            self._past.popleft()
        if len(self._past) == 1:
            self._learnt = photograph.time
        metered = {well: pump.metered for well, pump in pumps.items()}
        self._newest = _Standing(self._past[-1], tuple(self.learning.members()), metered)

    def outlook(
        self,
        plan: Sequence[RateStep],
        horizon: float,
        times: Iterable[float],
        map_times: Iterable[float] = (),
        *,
        executor: Executor | None = None,
        numbers: Sequence[int] = (),
    ) -> Outlook:
        """Return the expectations from the newest state on; any thread may ask at any time.

        Args:
            plan: the rates as commanded; its times count from the newest state.
            horizon: how long [s].
            times: after the newest state [s], increasing.
            map_times: after the newest state [s], increasing; when maps are wanted.
            executor: runs the courses instead of the usual one.
            numbers: of the siblings that are asked; empty: all.

        Raises:
            InputError: a course cannot be run.
        """
        after, maps_after = np.array(list(times)), np.array(list(map_times))
        begin, members, metered = self._standing()
        asked = np.array(numbers or range(len(members)))
        told = [step._replace(rates=delivered(step.rates, metered)) for step in plan]
        periods = plan_periods(told, begin.time, horizon)
        # the mean of all, on both grids, shows the smear of the coarse grid
        fine, coarse, *courses = self._run(
            [
                self._order(begin, begin.mean, periods, after, np.empty(0), self.map_grid),
                self._order(begin, begin.mean, periods, after, after),
                *(self._order(begin, members[one], periods, after, maps_after) for one in asked),
            ],
            executor,
        )
        tracer = np.array([course.zone_tracer for course in courses])
        tracer = np.maximum(tracer + fine.zone_tracer - coarse.zone_tracer, 0.0)
        area = np.array([course.zone_area for course in courses])
        area = np.maximum(area + fine.zone_area - coarse.zone_area, 0.0)
        maps = np.array([course.maps for course in courses])
        bands = self._bands(tracer, area, coarse.maps, after)
        reached = np.maximum.accumulate(tracer, axis=1) > self.zone.reached_tracer
        reached_share = reached.mean(axis=0) if self.zone.known else np.full(len(after), np.nan)
        return Outlook(
            begin.time,
            tuple(plan),
            horizon,
            after,
            *bands,
            reached_share,
            maps_after,
            maps.mean(axis=0),
            maps.std(axis=0),
            tuple(map(int, asked[np.argsort(tracer.sum(axis=1), kind='stable')])),
        )

    def _bands(
        self, tracer: FloatArray, area: FloatArray, mean: FloatArray, times: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the bands of tracer and area in the zone, (3, times).

        Args:
            tracer: [m^3] that each sibling expects, (siblings, times).
            area: [m^2], (siblings, times).
            mean: maps of the mean belief (times, nz, nx) [-].
            times: after the newest state [s], (times,).
        """
        tracer_band = self.tracer_check.widened(np.quantile(tracer, BAND, axis=0), times)
        area_band = self.area_check.widened(np.quantile(area, BAND, axis=0), times)
        zone, distances = self._zones[self.grid], self.front_check.distances(times)
        if not zone.known:
            return tracer_band, area_band
        return (
            widened(tracer_band, mean, distances, self.grid, zone.tracer),
            widened(area_band, mean, distances, self.grid, zone.plume_area),
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
        usual = standing.begin.mean.rate_factors
        nz, nx = initial.shape
        return [
            CostOrder(
                self.rig,
                self.rig.grid(nx, nz),
                one,
                usual,
                initial,
                tuple(plan),
                horizon,
                tuple(terms),
                with_gradient,
            )
            for one in (standing.members[number] for number in numbers)
        ]

    def _run(self, orders: Iterable[CourseOrder], executor: Executor | None = None) -> list[Course]:
        return list((executor or self._executor).map(run_course, list(orders)))

    def _order(
        self,
        begin: _Moment,
        sibling: Sibling,
        periods: Sequence[RatePeriod],
        times: FloatArray,
        map_times: FloatArray,
        grid: Grid | None = None,
    ) -> CourseOrder:
        """Return the order of a sibling's course from `begin`, with times [s] after it."""
        grid = grid or self.grid
        true_state = begin.state - sibling.photograph_error * begin.systematic
        return CourseOrder(
            self.rig,
            grid,
            sibling,
            conservative_resample(np.clip(true_state, 0.0, 1.0), grid.shape),
            tuple(periods),
            self._zones[grid] if len(times) else None,
            tuple(float(begin.time + time) for time in times),
            tuple(float(begin.time + time) for time in map_times),
        )

    def _expected(self, time: float) -> FloatArray:
        """Return the map (nz, nx) that a photograph at `time` [s] would show by the mean belief."""
        last, mean = self._past[-1], self.learning.mean()
        after = np.array([time - last.time])
        order = self._order(last, mean, last.periods, np.empty(0), after, self.map_grid)
        (course,) = self._run([order])
        return course.maps[0] + mean.photograph_error * last.systematic

    def _check_forecast(self) -> None:
        """Compare the plume in the zone with its forecast by the mean of some minutes ago.

        The pumps count as the hub knows them now: its news is no doubt any more.
        """
        now = self._past[-1]
        old = [moment for moment in self._past if now.time - moment.time >= CHECK_S]
        if not old or self._learnt != now.time or not self.zone.known:
            return
        begin = old[-1]
        periods = [
            period
            for moment in self._past
            if moment.time >= begin.time
            for period in moment.periods
        ]
        after = np.array([now.time - begin.time])
        mean = begin.mean.with_pumps_of(now.mean)
        order = self._order(begin, mean, periods, after, after, self.map_grid)
        (course,) = self._run([order])
        seen = np.clip(now.state - now.mean.photograph_error * now.systematic, 0.0, 1.0)
        self.front_check.compare(front_miss(course.maps[0], seen, self.map_grid))
        self.area_check.compare(float(course.zone_area[0]), self.zone.plume_area(seen))
        self.tracer_check.compare(float(course.zone_tracer[0]), self.zone.tracer(seen))

    def _learn(self, photograph: Photograph) -> None:
        """Update the belief by how well each sibling expected `photograph` from a window ago."""
        begin = self._past[0]
        length = photograph.time - begin.time
        elapsed = photograph.time - self._learnt
        self._learnt = photograph.time
        self.learning.fade(elapsed)
        periods = [period for moment in self._past for period in moment.periods]
        members = self.learning.members()
        courses = self._run(
            self._order(begin, one, periods, np.empty(0), np.array([length])) for one in members
        )
        # photographs of one window judge nearly the same course: together they count as one
        self.learning.learn(
            photograph, members, [course.maps[0] for course in courses], alike=length / elapsed
        )
