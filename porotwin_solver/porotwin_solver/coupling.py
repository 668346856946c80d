"""Flow that the tracer itself moves: buoyancy and viscosity.

q = -k / mu(c) (grad p + density_difference c g e_z),    mu(c) = mu_water viscosity_ratio^c
"""

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from porotwin_core.grid import FloatArray
from porotwin_core.units import GRAVITY
from porotwin_core.wells import WellRates
from porotwin_solver.flow import FaceField, Flow, transmissibilities
from porotwin_solver.openings import Openings
from porotwin_solver.physics import Physics

TOLERANCE = 1e-8
"""Relative residual of the pressure; pure water carries what remains (see `Coupling.flux`)."""


class Coupling:
    """The part of the flow that the tracer drives, for the coefficients of one grid."""

    def __init__(self, physics: Physics) -> None:
        """Factorise the flow of pure water on the grid of `physics`."""
        self.physics = physics
        self.grid = physics.grid
        self._openings = Openings(physics)
        self._water = Flow(
            self.grid, physics.depth * physics.permeability / physics.viscosity, physics.boundaries
        )

    def flux(self, rates: WellRates, concentration: FloatArray) -> FaceField:
        """Return the flux [m^3/s] with tracer less that of pure water under the same `rates`.

        Free of divergence to round-off. Where the viscosity varies, the factor of pure water
        preconditions conjugate gradients, and the flow of pure water carries what they leave.
        """
        physics, water = self.physics, self._water
        if physics.viscosity_ratio == 1.0:
            driven = buoyant_flux(physics, water.transmissibility, concentration)
            return water.flux(np.zeros(self.grid.shape), driven)
        source = self._openings.sources(rates).net
        mobility = (
            physics.permeability / physics.viscosity * physics.viscosity_ratio**-concentration
        )
        trans = transmissibilities(self.grid, physics.depth * mobility, physics.boundaries)
        driven = buoyant_flux(physics, trans, concentration)
        flux = self._pressure_driven(trans, source - driven.divergence()) + driven
        difference = flux + water.flux(source) * -1.0
        return difference + water.flux(-difference.divergence())

    def _pressure_driven(self, trans: FaceField, source: FloatArray) -> FaceField:
        shape, water = self.grid.shape, self._water

        def outflow(pressure: FloatArray) -> FloatArray:
            flux = water.pressure_flux(pressure.reshape(shape), trans)
            result = flux.divergence().ravel()
            result[0] += water.pin * pressure.ravel()[0]
            return result

        pressure, _ = cg(
            LinearOperator((source.size,) * 2, matvec=outflow, dtype=float),
            source.ravel(),
            rtol=TOLERANCE,
            maxiter=200,
            M=LinearOperator((source.size,) * 2, matvec=water.solve, dtype=float),
        )
        return water.pressure_flux(pressure.reshape(shape), trans)


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
