"""Flow that the tracer itself moves: buoyancy and viscosity.

q = -k / mu(c) (grad p + density_difference c g e_z),    mu(c) = mu_water viscosity_ratio^c
"""

import math

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.units import GRAVITY
from porotwin_core.wells import WellRates
from porotwin_solver.flow import (
    FaceField,
    flow_of,
    transmissibilities,
    transmissibilities_adjoint,
)
from porotwin_solver.physics import Physics
from porotwin_solver.sources_and_sinks import SourcesAndSinks

TOLERANCE = 1e-8
"""Relative residual of the pressure; pure water carries what remains (see `Coupling.flux`)."""

MOST_ITERATIONS = 1000
"""Enough for viscosity ratios from 1 / 1000 to 1000."""


class Coupling:
    """The part of the flow that the tracer drives, for the coefficients of one grid."""

    def __init__(self, physics: Physics) -> None:
        """Factorise the flow of pure water on the grid of `physics`."""
        self.physics = physics
        self.grid = physics.grid
        self.sources_and_sinks = SourcesAndSinks(physics)
        self._water = flow_of(
            self.grid, physics.depth * physics.permeability / physics.viscosity, physics.boundaries
        )

    def flux(self, rates: WellRates, concentration: FloatArray) -> FaceField:
        """Return the flux [m^3/s] with tracer less that of pure water under the same `rates`.

        Free of divergence to round-off. Where the viscosity varies, the factor of pure water
        preconditions conjugate gradients, and the flow of pure water carries what they leave.

        Raises:
            InputError: the viscosities differ too much for that.
        """
        physics, water = self.physics, self._water
        if physics.viscosity_ratio == 1.0:
            driven = buoyant_flux(physics, water.transmissibility, concentration)
            return water.flux(np.zeros(self.grid.shape), driven)
        source = self.sources_and_sinks.sources(rates).net
        trans = self._transmissibility(concentration)
        driven = buoyant_flux(physics, trans, concentration)
        pressure = self._pressure(trans, source - driven.divergence())
        difference = water.pressure_flux(pressure, trans) + driven + water.flux(source) * -1.0
        return difference + water.flux(-difference.divergence())

    def flux_adjoint(
        self, rates: WellRates, concentration: FloatArray, bar: FaceField
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives by `concentration` and by the wells' source of every cell.

        `bar` holds those of a cost by `flux`. The pressure's matrix is symmetric: its adjoint is
        one more solution.
        """
        physics, ones = self.physics, FaceField.zeros(self.grid)
        ones.x[:], ones.z[:] = 1.0, 1.0
        trans = self._transmissibility(concentration)
        back = self._pressure(trans, (trans * bar).divergence())
        left = bar + self._water.pressure_flux(back, ones) * -1.0
        weight = -physics.density_difference * GRAVITY * self.grid.dz
        on_faces = 0.5 * weight * trans.z * left.z
        by_concentration = on_faces[:-1] + on_faces[1:]
        if physics.viscosity_ratio == 1.0:
            return by_concentration, np.zeros(self.grid.shape)
        source = self.sources_and_sinks.sources(rates).net
        driven = buoyant_flux(physics, trans, concentration)
        pressure = self._pressure(trans, source - driven.divergence())
        by_trans = self._water.pressure_flux(pressure, ones) * left
        by_trans.z[:] += buoyant_flux(physics, ones, concentration).z * left.z
        conductance = self._conductance(concentration)
        by_conductance = transmissibilities_adjoint(self.grid, conductance, trans, by_trans)
        by_concentration -= by_conductance * conductance * math.log(physics.viscosity_ratio)
        water = (self._water.transmissibility * bar).divergence()
        by_source = back - self._water.solve(water.ravel()).reshape(self.grid.shape)
        return by_concentration, by_source

    def _conductance(self, concentration: FloatArray) -> FloatArray:
        physics = self.physics
        viscosity = physics.viscosity * physics.viscosity_ratio**concentration
        return physics.depth * physics.permeability / viscosity

    def _transmissibility(self, concentration: FloatArray) -> FaceField:
        if self.physics.viscosity_ratio == 1.0:
            return self._water.transmissibility
        return transmissibilities(
            self.grid, self._conductance(concentration), self.physics.boundaries
        )

    def _pressure(self, trans: FaceField, source: FloatArray) -> FloatArray:
        shape, water = self.grid.shape, self._water
        if trans is water.transmissibility:
            return water.solve(source.ravel()).reshape(shape)

        def outflow(pressure: FloatArray) -> FloatArray:
            flux = water.pressure_flux(pressure.reshape(shape), trans)
            result = flux.divergence().ravel()
            result[0] += water.pin * pressure.ravel()[0]
            return result

        pressure, unfinished = cg(
            LinearOperator((source.size,) * 2, matvec=outflow, dtype=float),
            source.ravel(),
            rtol=TOLERANCE,
            maxiter=MOST_ITERATIONS,
            M=LinearOperator((source.size,) * 2, matvec=water.solve, dtype=float),
        )
        if unfinished:
            raise InputError(
                f'viscosity_ratio {self.physics.viscosity_ratio:g}: the pressure is not found in '
                f'{MOST_ITERATIONS} iterations; choose a ratio closer to 1'
            )
        return np.asarray(pressure).reshape(shape)


def buoyant_flux(physics: Physics, trans: FaceField, concentration: FloatArray) -> FaceField:
    """Return -T dz density_difference g c on level faces [m^3/s]; outside an open side is water."""
    grid = physics.grid
    flux = FaceField.zeros(grid)
    if physics.density_difference == 0.0:
        return flux
    weight = -physics.density_difference * GRAVITY * grid.dz
    flux.z[1:-1] = trans.z[1:-1] * weight * 0.5 * (concentration[:-1] + concentration[1:])
    flux.z[0] = trans.z[0] * weight * 0.5 * concentration[0]
    flux.z[-1] = trans.z[-1] * weight * 0.5 * concentration[-1]
    return flux
