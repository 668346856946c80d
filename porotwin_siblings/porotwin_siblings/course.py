"""One sibling's course: its own physics, run through a schedule of rates.

A `CourseOrder` can be pickled, so any executor may run it: threads, processes, or a Dask cluster.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.delivered_rates import delivered
from porotwin_core.rates.rates_in_force import RatePeriod
from porotwin_core.rig import Rig
from porotwin_siblings.traits import TRANSVERSE_SHARE, WAVES, Traits
from porotwin_siblings.zone_measure import ZoneMeasure
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import described_physics
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
        traits: of the sibling.
        initial: concentration at the start of the first period, (nz, nx) [-].
        periods: consecutive rates as commanded, or as measured.
        zone: measures to take; None: none.
        times: when [s] they are taken, increasing, within the periods.
        map_times: when [s] the map is kept, increasing, within the periods.
    """

    rig: Rig
    grid: Grid
    traits: Traits
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
    engine = engine_of(order.rig, order.grid, order.traits)
    state = State.equilibrium(np.asarray(order.initial, dtype=float))
    tracer, area, maps = [], [], []
    moments = sorted({*order.times, *order.map_times})
    now = order.periods[0].start
    for moment in moments:
        for period in order.periods:
            low, high = max(period.start, now), min(period.end, moment)
            if high > low:
                rates = delivered(period.rates, order.traits.rate_factors, closed=order.rig.closed)
                engine.advance(state, rates, high - low)
        now = max(now, moment)
        seen = engine.mean_concentration(state)
        if moment in order.times and order.zone is not None:
            tracer.append(order.zone.tracer(seen))
            area.append(order.zone.plume_area(seen))
        if moment in order.map_times:
            maps.append(seen.copy())
    return Course(np.array(tracer), np.array(area), np.array(maps).reshape(-1, *order.grid.shape))


def engine_of(rig: Rig, grid: Grid, traits: Traits) -> Engine:
    """Return the engine of a sibling on `grid`. Its rates are those that the pumps deliver."""
    coarse = grid
    if grid.nx % COARSENING == 0 and grid.nz % COARSENING == 0:
        coarse = rig.grid(grid.nx // COARSENING, grid.nz // COARSENING)
    return Engine(
        sibling_physics(rig, grid, traits),
        scheme=Scheme.SUPERBEE,
        coupled_physics=sibling_physics(rig, coarse, traits),
        longest_step=LONGEST_STEP_S,
    )


def sibling_physics(rig: Rig, grid: Grid, traits: Traits) -> Physics:
    """Return the coefficients of the rig on `grid` as a sibling believes them."""
    return with_traits(traits, described_physics(rig, grid, traits.effects))


def with_traits(traits: Traits, physics: Physics) -> Physics:
    """Return the coefficients of `physics` as a sibling believes them, without its effects."""
    along = traits.longitudinal_dispersivity
    (have_x, have_z), (more_x, more_z) = physics.background_flux, traits.background_flux
    waves = log_permeability(physics.grid, traits.waves)
    return replace(
        physics,
        longitudinal_dispersivity=physics.longitudinal_dispersivity + along,
        transverse_dispersivity=physics.transverse_dispersivity + TRANSVERSE_SHARE * along,
        density_difference=physics.density_difference + traits.density_difference,
        porosity=np.minimum(physics.porosity * traits.porosity_factor, 1.0),
        background_flux=(have_x + more_x, have_z + more_z),
        permeability=physics.permeability * traits.permeability_factor * np.exp(waves),
    )


def log_permeability(grid: Grid, waves: Sequence[float]) -> FloatArray:
    """Return the log of the factor on the permeability, (nz, nx): a sum of cosines, `WAVES`."""
    total = np.zeros(grid.shape)
    for amplitude, (along_x, along_z) in zip(waves, WAVES, strict=False):
        total += amplitude * np.outer(
            np.cos(math.pi * along_z * grid.z / grid.height),
            np.cos(math.pi * along_x * grid.x / grid.width),
        )
    return total
