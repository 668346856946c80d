"""Simulated readings of a balance, of manometers and of the outflow.

The excess pressure p over resting water follows from the flux q through the faces. With the
transmissibility T and the flux b that the weight of the tracer drives, q = -T grad p + b on every
face inside the sand. The sum of (b - q) / T along a row of cells and then along a column gives the
difference of two ports, whatever drives the water: wells, heads, rain or a background flow.
"""

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np

from porotwin_core.basis.blas_threads import one_blas_thread
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading, Port
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.refinement import refine
from porotwin_solver.coefficients.water_contact import Outline, entering
from porotwin_solver.flow.flow import transmissibilities
from porotwin_solver.model.coupling import buoyant_flux
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.model.free_run_step import longest_free_step
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import intervals
from porotwin_solver.model.water_balance import SIDES, at_sides, into_canals


@one_blas_thread()
def simulated_readings(
    rig: Rig,
    schedule: Schedule,
    readings: Sequence[GaugeReading],
    *,
    grid: Grid,
    preset: str = 'accurate',
    effects: Iterable[EffectDescription] = (),
    initial: FloatArray | None = None,
    start: float,
    refinement: int | None = None,
) -> FloatArray:
    """Return the values of the model for each of the `readings`, in their units, (n,).

    The arguments are as in `simulation.simulated_maps`. Readings before `start` [s] are NaN.
    The tracer moves only where a reading depends on it.

    Raises:
        InputError: a place or a port that the rig does not have, or as `simulated_maps`.
    """
    model = Model(rig, grid, preset=preset, effects=effects, refinement=refinement)
    begin = (
        model.initial_condition() if initial is None else model.validated_map(initial, 'initial')
    )
    run = _Run(rig, model.engine, refine(begin, model.engine.grid.shape))
    run.needs_tracer |= any(one.kind is GaugeKind.CONCENTRATION for one in readings)
    found = np.full(len(readings), np.nan)
    now = start
    for index in sorted(range(len(readings)), key=lambda k: readings[k].time):
        one = readings[index]
        if one.time < start:
            continue
        for low, high, engine, rates in intervals(model, schedule, now, one.time):
            run.advance(engine, rates, high - low)
        now = one.time
        run.engine = model.at(now).engine
        found[index] = run.value(one, schedule.at(now))
    return found


class _Run:
    """A run of the model, with the water that has left through each outlet.

    Attributes:
        engine: the engine with the effects that act now.
        needs_tracer: whether the tracer moves, because the flow or a reading depends on it.
    """

    def __init__(self, rig: Rig, engine: Engine, concentration: FloatArray) -> None:
        self._rig, self.engine = rig, engine
        self._state = State.equilibrium(concentration)
        self._left: dict[str, float] = {}
        self.needs_tracer = engine.coupling is not None

    def advance(self, engine: Engine, rates: WellRates, duration: float) -> None:
        """Run `engine` for `duration` [s] at constant `rates`."""
        self.engine = engine
        longest = longest_free_step(engine.physics, rates)
        count, length = engine.splitting(duration, longest) if self.needs_tracer else (1, duration)
        for _ in range(count):
            for name, rate in self._outflow(rates).items():
                self._left[name] = self._left.get(name, 0.0) + rate * length
            if self.needs_tracer:
                engine.advance(self._state, rates, length, longest)

    def value(self, reading: GaugeReading, rates: WellRates) -> float:
        """Return the value of the model for `reading` at `rates`."""
        if reading.kind is GaugeKind.PRESSURE:
            assert reading.port is not None
            return self._pressure(reading.port, reading.against, rates)
        if reading.place not in self._outflow(rates):
            known = ', '.join(self._outflow(rates))
            raise InputError(f"unknown place '{reading.place}'; the rig has {known}")
        if reading.kind is GaugeKind.OUTFLOW:
            return self._left.get(reading.place, 0.0)
        return self._concentration(reading.place, rates)

    def _flux(self, rates: WellRates) -> FaceField:
        engine = self.engine
        return engine.coupled_flux(engine.water_flux(rates), rates, self._state.mobile)

    def _outflow(self, rates: WellRates) -> dict[str, float]:
        """Return the water that leaves [m^3/s] by well, side and other water."""
        rig, grid, flux = self._rig, self.engine.grid, self._flux(rates)
        wells = self.engine.physics.delivered(rates)
        into = {**wells, **at_sides(rig, grid, entering(flux)), **into_canals(rig, grid, flux)}
        nothing = dict.fromkeys((*rig.wells, *SIDES), 0.0)
        return {**nothing, **{name: -rate for name, rate in into.items()}}

    def _concentration(self, place: str, rates: WellRates) -> float:
        """Return the mean concentration [-] of the water that leaves at `place`; 0 if none does.

        Raises:
            InputError: `place` is a canal, whose own mixture the model does not have.
        """
        engine, c = self.engine, self._state.mobile
        if place in self._rig.water and self._rig.water[place].side is None:
            raise InputError(f"a concentration is read at a well or a side, not in '{place}'")
        if place in self._rig.wells:
            return engine.sources_and_sinks.disc_mean(engine.physics.wells[place], c)
        leaving = entering(self._flux(rates)).map(lambda into: np.maximum(-into, 0.0))
        beside = Outline(c[:, 0], c[:, -1], c[0], c[-1])
        carried, water = (
            at_sides(self._rig, engine.grid, part).get(place, 0.0)
            for part in (leaving.map(np.multiply, beside), leaving)
        )
        return carried / water if water > 0.0 else 0.0

    def _pressure(self, port: Port, against: Port | None, rates: WellRates) -> float:
        """Return the pressure [Pa] at `port` minus the one `against` it, or of the water.

        Raises:
            InputError: a port outside the sand, no open water, or no sand on the way.
        """
        engine, c = self.engine, self._state.mobile
        physics, grid = engine.physics, engine.grid
        mobility = physics.mobility_thickness / physics.viscosity_ratio**c
        trans = transmissibilities(grid, mobility, engine.contact(rates))
        flux = self._flux(rates)
        rises = _rises(flux, buoyant_flux(physics, trans, c), trans)
        if against is None:
            base, level = _at_water(flux, trans, physics.at_levels(rates))
        else:
            base = _cells_around(grid, against)[0][0]
            level = -_between(grid, base, against, rises)
        found = level + _between(grid, base, port, rises)
        if not np.isfinite(found):
            raise InputError(
                f'no wet sand lies between the ports {port} and {against or "the open water"}'
            )
        return found


Cell = tuple[int, int]
"""Row and column of a cell."""


def _rises(flux: FaceField, driven: FaceField, trans: FaceField) -> FaceField:
    """Return the rise of the pressure [Pa] across every inner face; NaN where no water flows."""
    with np.errstate(divide='ignore', invalid='ignore'):
        x = (driven.x - flux.x) / np.where(trans.x > 0.0, trans.x, np.nan)
        z = (driven.z - flux.z) / np.where(trans.z > 0.0, trans.z, np.nan)
    return FaceField(x[:, 1:-1], z[1:-1])


def _between(grid: Grid, base: Cell, port: Port, rises: FaceField) -> float:
    """Return the pressure [Pa] at `port`, interpolated between cells, minus the one of `base`."""
    return sum(share * _along(base, cell, rises) for cell, share in _cells_around(grid, port))


def _along(base: Cell, cell: Cell, rises: FaceField) -> float:
    """Return the pressure [Pa] of `cell` minus the one of `base`: along a row, and up a column.

    Where no water flows on that way, it goes up first; NaN if no water flows there either.
    """
    (row, column), (to_row, to_column) = base, cell

    def sum_of(values: FloatArray, begin: int, end: int) -> float:
        part = values[min(begin, end) : max(begin, end)].sum()
        return float(part if end >= begin else -part)

    ways = (
        sum_of(rises.x[at_row], column, to_column) + sum_of(rises.z[:, at_column], row, to_row)
        for at_row, at_column in ((row, to_column), (to_row, column))
    )
    return next((way for way in ways if np.isfinite(way)), np.nan)


def _cells_around(grid: Grid, port: Port) -> list[tuple[Cell, float]]:
    """Return the cells around `port` with their shares in an interpolation, the nearest first.

    Raises:
        InputError: it lies outside the sand.
    """
    x, z = port
    if not (0.0 <= x <= grid.width and 0.0 <= z <= grid.height):
        raise InputError(f'the port at x {x:g} m, z {z:g} m lies outside the sand')
    shares = [
        _neighbours(place * count / length - 0.5, count)
        for place, count, length in ((z, grid.nz, grid.height), (x, grid.nx, grid.width))
    ]
    found = [((row, column), a * b) for (row, a), (column, b) in product(*shares) if a * b > 0.0]
    return sorted(found, key=lambda one: -one[1])


def _neighbours(place: float, count: int) -> list[tuple[int, float]]:
    """Return the two of `count` cells around `place` [cells] with their shares."""
    place = min(max(place, 0.0), count - 1.0)
    low = min(int(place), max(count - 2, 0))
    return [(low, 1.0 - (place - low)), (min(low + 1, count - 1), place - low)]


def _at_water(flux: FaceField, trans: FaceField, physics: Physics) -> tuple[Cell, float]:
    """Return a cell beside open water, and its pressure [Pa] above the lowest water.

    Raises:
        InputError: no water stands at a side.
    """
    nz, nx = trans.x.shape[0], trans.z.shape[1]
    touch = Outline(trans.x[:, 0], trans.x[:, -1], trans.z[0], trans.z[-1])
    side = max(range(4), key=lambda k: touch[k].max())
    at = int(touch[side].argmax())
    if not touch[side][at] > 0.0:
        raise InputError('a pressure needs a second port: no water stands at a side of the rig')
    cell = [(at, 0), (at, nx - 1), (0, at), (nz - 1, at)][side]
    potentials = physics.water_potentials
    level = 0.0 if potentials is None else float(potentials[0][side][at])
    return cell, level - float(entering(flux)[side][at] / touch[side][at])
