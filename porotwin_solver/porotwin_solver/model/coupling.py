"""Flow that depends on the tracer: buoyancy and viscosity.

q = -k / mu(c) (grad p + density_difference c g e_z),    mu(c) = mu_water viscosity_ratio^c
"""

import math
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRates
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.flow.background_flux import driven_by_water, side_flux
from porotwin_solver.flow.flow import (
    SHARED_FLOWS,
    pressure_flux,
    transmissibilities,
    transmissibilities_adjoint,
)
from porotwin_solver.flow.multigrid import GridLevel, Multigrid, conjugate_gradients
from porotwin_solver.flow.pressure import (
    COARSEST_CELLS,
    MAX_ITERATIONS,
    WORTHWHILE_ITERATIONS,
    factorised,
)
from porotwin_solver.transport.sources_and_sinks import SourcesAndSinks

TOLERANCE = 1e-7
"""Relative residual of the pressure; the flow of pure water absorbs the rest (`Coupling.flux`).
Maps differ by less than 1e-6 from those with 1e-11; any scheme errs a thousand times as much."""

LARGEST_PRECONDITIONED = 30_000
"""Cells above which multigrid for the varying viscosity is faster than conjugate gradients with the
factor of pure water: 16 instead of 28 ms on 42 000 cells at a ratio of 0.5, 8 instead of 9 ms on
21 000."""

STRONG_RATIO, LARGEST_STRONG = 5.0, 2_000
"""Smallest ratio of the viscosities, or its inverse, at which multigrid is faster on grids of more
than `LARGEST_STRONG` cells: 8 instead of 16 ms at a ratio of 0.15 on 21 000 cells."""


class PureWater(NamedTuple):
    """The flow of pure water at the same `rates`.

    source: net injection of the wells and leaks [m^3/s], (nz, nx).
    pressure: [Pa], (nz, nx).
    flux: through the faces [m^3/s].
    """

    rates: WellRates
    source: FloatArray
    pressure: FloatArray
    flux: FaceField


class Coupling:
    """The part of the flow that the tracer drives, for the coefficients of one grid."""

    def __init__(self, physics: Physics, *, max_iterations: int = MAX_ITERATIONS) -> None:
        """Prepare the flow of pure water on the grid of `physics`."""
        self.physics = physics
        self.grid = physics.grid
        self.sources_and_sinks = SourcesAndSinks(physics)
        self._max_iterations = max_iterations
        self._pure_water: PureWater | None = None
        self._water = SHARED_FLOWS.flow(self.grid, physics.mobility_thickness, physics.contact)

    def flux(self, rates: WellRates, concentration: FloatArray) -> FaceField:
        """Return the flux [m^3/s] with tracer minus the flux of pure water at the same `rates`.

        `concentration` is (nz, nx). The divergence is zero to round-off. With a varying viscosity
        the pressure is iterated, and a flow of pure water removes the divergence that is left.

        Raises:
            InputError: the iteration does not converge because the viscosities differ too much.
        """
        physics, water = self.physics, self._water
        if physics.viscosity_ratio == 1.0:
            driven = buoyant_flux(physics, water.transmissibility, concentration)
            return water.flux(np.zeros(self.grid.shape), driven)
        pure = self._pure(rates)
        trans = self._transmissibility(concentration)
        driven = self._driven(trans, concentration)
        pressure = self._pressure(trans, pure.source - driven.divergence(), pure.pressure)
        difference = pressure_flux(pressure, trans) + driven + pure.flux * -1.0
        return water.without_divergence(difference)

    def _pure(self, rates: WellRates) -> PureWater:
        """Return the flow of pure water that `rates` and heads of open sides drive.

        The latest one is kept.
        """
        kept = self._pure_water
        if kept is None or kept.rates != rates:
            water = self._water
            source = self.sources_and_sinks.sources(rates).net
            by_sides = driven_by_water(self.physics, water.transmissibility)
            total = source if by_sides is None else source - by_sides.divergence()
            total = self.physics.contact.where_canal(total, np.zeros(self.grid.shape))
            pressure = water.solve(total.ravel()).reshape(self.grid.shape)
            kept = PureWater(dict(rates), source, pressure, water.flux(source, by_sides))
            self._pure_water = kept
        return kept

    def _driven(self, trans: FaceField, concentration: FloatArray) -> FaceField:
        """Return the flux [m^3/s] that density, the heads of water and rain drive."""
        buoyant = buoyant_flux(self.physics, trans, concentration)
        by_water = driven_by_water(self.physics, trans)
        return buoyant if by_water is None else buoyant + by_water

    def flux_adjoint(
        self, rates: WellRates, concentration: FloatArray, bar: FaceField
    ) -> tuple[FloatArray, FloatArray]:
        """Return dJ/dconcentration and dJ/dsource, (nz, nx) each, of a cost J.

        `bar` is dJ/dflux. `source` is the net injection of the wells [m^3/s]. The matrix of the
        pressure is symmetric, so its adjoint is one more solution.

        Raises:
            InputError: as `flux`.
        """
        physics, ones = self.physics, FaceField.zeros(self.grid)
        ones.x[:], ones.z[:] = 1.0, 1.0
        trans = self._transmissibility(concentration)
        adjoint_pressure = self._pressure(trans, (trans * bar).divergence())
        by_flux = bar + pressure_flux(adjoint_pressure, ones) * -1.0
        weight = -physics.density_difference * GRAVITY * self.grid.dz
        on_faces = 0.5 * weight * trans.z * by_flux.z
        nothing = np.zeros(self.grid.shape)
        by_concentration = physics.contact.where_canal(on_faces[:-1] + on_faces[1:], nothing)
        if physics.viscosity_ratio == 1.0:
            return by_concentration, np.zeros(self.grid.shape)
        pure = self._pure(rates)
        driven = self._driven(trans, concentration)
        pressure = self._pressure(trans, pure.source - driven.divergence(), pure.pressure)
        per_trans = pressure_flux(pressure, ones) + buoyant_flux(physics, ones, concentration)
        if (by_heads := side_flux(physics, ones)) is not None:
            per_trans = per_trans + by_heads
        by_trans = per_trans * by_flux
        mobility_thickness = self._mobility_thickness(concentration)
        by_mobility = transmissibilities_adjoint(
            self.grid, mobility_thickness, trans, by_trans, physics.contact
        )
        by_concentration -= by_mobility * mobility_thickness * math.log(physics.viscosity_ratio)
        water = (self._water.transmissibility * bar).divergence()
        water = physics.contact.where_canal(water, nothing)
        by_source = adjoint_pressure - self._water.solve(water.ravel()).reshape(self.grid.shape)
        return by_concentration, by_source

    def _mobility_thickness(self, concentration: FloatArray) -> FloatArray:
        physics = self.physics
        # exp takes half as long as a power
        return physics.mobility_thickness * np.exp(
            -math.log(physics.viscosity_ratio) * concentration
        )

    def _transmissibility(self, concentration: FloatArray) -> FaceField:
        if self.physics.viscosity_ratio == 1.0:
            return self._water.transmissibility
        return transmissibilities(
            self.grid, self._mobility_thickness(concentration), self.physics.contact
        )

    def _pressure(
        self, trans: FaceField, source: FloatArray, begin: FloatArray | None = None
    ) -> FloatArray:
        """Return the pressure [Pa] for `source` (nz, nx) [m^3/s] and transmissibilities `trans`.

        `begin` (nz, nx) [Pa] is a first guess.
        """
        shape, water = self.grid.shape, self._water
        source = self.physics.contact.where_canal(source, np.zeros(shape))
        if trans is water.transmissibility:
            return water.solve(source.ravel()).reshape(shape)
        strong = abs(math.log(self.physics.viscosity_ratio)) > math.log(STRONG_RATIO)
        pressure = None
        if source.size > (LARGEST_STRONG if strong else LARGEST_PRECONDITIONED):
            pressure = self._by_multigrid(trans, source, begin)
        if pressure is None:
            pressure = self._by_water(trans, source, begin)
        if pressure is None:
            raise InputError(
                f'viscosity_ratio {self.physics.viscosity_ratio:g}: the pressure does not converge '
                f'in {self._max_iterations} iterations; choose a ratio closer to 1, or sands that '
                'differ less'
            )
        return pressure

    def _by_multigrid(
        self, trans: FaceField, source: FloatArray, begin: FloatArray | None
    ) -> FloatArray | None:
        """Return the pressure; None where cells are long or the sand differs too much."""
        level = GridLevel.of(trans, pin=self._water.pin, canal=self._water.canal)
        cycles = Multigrid(level, factorised, largest_factor=COARSEST_CELLS)
        most = min(WORTHWHILE_ITERATIONS, self._max_iterations)
        return cycles.solve(source, begin=begin, tolerance=TOLERANCE, most_iterations=most)

    def _by_water(
        self, trans: FaceField, source: FloatArray, begin: FloatArray | None
    ) -> FloatArray | None:
        """Return the pressure by conjugate gradients; the factor of pure water preconditions."""
        level = GridLevel.of(trans, pin=self._water.pin, canal=self._water.canal)

        def of_water(residual: FloatArray) -> FloatArray:
            potential = level.potential()
            potential[1:-1, 1:-1] = self._water.solve(residual.ravel()).reshape(level.shape)
            return potential

        return conjugate_gradients(
            level,
            source,
            of_water,
            begin=begin,
            tolerance=TOLERANCE,
            most_iterations=self._max_iterations,
        )


def buoyant_flux(physics: Physics, trans: FaceField, concentration: FloatArray) -> FaceField:
    """Return -T dz density_difference g c on horizontal faces [m^3/s].

    `trans` is the transmissibility T [m^3/(s Pa)], `concentration` (nz, nx). Water beyond an open
    side acts by its potential alone, and a canal has the concentration of its water.
    """
    grid, contact = physics.grid, physics.contact
    concentration = contact.where_canal(concentration, contact.canal_concentration)
    flux = FaceField.zeros(grid)
    if physics.density_difference == 0.0:
        return flux
    weight = -physics.density_difference * GRAVITY * grid.dz
    flux.z[1:-1] = trans.z[1:-1] * weight * 0.5 * (concentration[:-1] + concentration[1:])
    flux.z[0] = trans.z[0] * weight * 0.5 * concentration[0]
    flux.z[-1] = trans.z[-1] * weight * 0.5 * concentration[-1]
    return flux
