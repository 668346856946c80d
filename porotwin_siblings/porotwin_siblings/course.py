"""One sibling's course: its own physics, run through a schedule of rates.

A `CourseOrder` can be pickled, so any executor may run it: threads, processes, or a Dask cluster.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.effect_parameter import onset
from porotwin_core.rates.delivered_rates import delivered
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rig import Rig
from porotwin_siblings.unknowns import Sibling
from porotwin_siblings.zone_measure import ZoneMeasure
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import described_physics, physics_on_top, rig_at
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.transport.scheme import Scheme

LONGEST_STEP_S = 300.0
"""Longest splitting step of a sibling [s]: the error is small beside their spread."""

COARSENING = 2
"""Factor by which the grid of the tracer-driven flow is coarser, where the grid allows it."""


@dataclass(frozen=True)
class CourseOrder:
    """A request for the course of a sibling.

    Attributes:
        rig: the rig as described.
        grid: grid of the sibling.
        sibling: whose course.
        initial: concentration at the start of the first period, (nz, nx) [-].
        periods: consecutive rates as commanded, or as measured.
        zone: measures to take; None: none.
        times: when [s] they are taken, increasing, within the periods.
        map_times: when [s] the map is kept, increasing, within the periods.
    """

    rig: Rig
    grid: Grid
    sibling: Sibling
    initial: FloatArray
    periods: tuple[RatePeriod, ...]
    zone: ZoneMeasure | None = None
    times: tuple[float, ...] = ()
    map_times: tuple[float, ...] = ()


class Course(NamedTuple):
    """Tracer [m^3] and area [m^2] in the zone, (times,), and maps [-], (map times, nz, nx)."""

    zone_tracer: FloatArray
    zone_area: FloatArray
    maps: FloatArray


def run_course(order: CourseOrder) -> Course:
    """Return the course that a sibling expects.

    Raises:
        InputError: as `Engine.advance`.
    """
    state = State.equilibrium(np.asarray(order.initial, dtype=float))
    tracer, area, maps = [], [], []
    moments = sorted({*order.times, *order.map_times})
    now = order.periods[0].start
    rig = rig_at(order.rig, now)
    engine, factors = engine_of(rig, order.grid, order.sibling)
    periods = _divided(order.periods, sorted({onset(one) for one in order.rig.effects}))
    for moment in moments:
        for period in periods:
            low, high = max(period.start, now), min(period.end, moment)
            if high > low:
                if (then := rig_at(order.rig, low)).effects != rig.effects:
                    rig = then
                    engine, factors = engine_of(rig, order.grid, order.sibling)
                rates = delivered(period.rates, factors, closed=order.rig.closed)
                engine.advance(state, rates, high - low)
        now = max(now, moment)
        seen = engine.mean_concentration(state)
        if moment in order.times and order.zone is not None:
            tracer.append(order.zone.tracer(seen))
            area.append(order.zone.plume_area(seen))
        if moment in order.map_times:
            maps.append(seen.copy())
    return Course(np.array(tracer), np.array(area), np.array(maps).reshape(-1, *order.grid.shape))


def _divided(periods: Sequence[RatePeriod], onsets: Sequence[float]) -> list[RatePeriod]:
    """Return `periods`, divided at the `onsets` [s] of effects, which increase."""
    return [
        RatePeriod(low, high, rates)
        for start, end, rates in periods
        for low, high in pairwise([start, *(one for one in onsets if start < one < end), end])
    ]


def engine_of(rig: Rig, grid: Grid, sibling: Sibling) -> tuple[Engine, Mapping[str, float]]:
    """Return the engine of a sibling on `grid`, and the factors of its pumps [-].

    The engine takes the delivered rates, because in a closed rig measured ones must balance first.
    """
    coarse = grid
    if grid.nx % COARSENING == 0 and grid.nz % COARSENING == 0:
        coarse = rig.grid(grid.nx // COARSENING, grid.nz // COARSENING)
    physics, coupled = (sibling_physics(rig, one, sibling) for one in (grid, coarse))
    engine = Engine(
        replace(physics, rate_factors={}),
        scheme=Scheme.SUPERBEE,
        coupled_physics=replace(coupled, rate_factors={}),
        longest_step=LONGEST_STEP_S,
    )
    return engine, physics.rate_factors


def sibling_physics(rig: Rig, grid: Grid, sibling: Sibling) -> Physics:
    """Return the coefficients of the rig on `grid` as a sibling believes them."""
    return physics_on_top(described_physics(rig, grid, sibling.diagnosed), sibling.changes)
