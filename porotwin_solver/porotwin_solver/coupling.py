"""Flow that the tracer itself moves: buoyancy and viscosity.

q = -k / mu(c) (grad p + density_difference c g e_z),    mu(c) = mu_water viscosity_ratio^c
"""

import numpy as np
from porotwin_core.grid import FloatArray
from porotwin_core.units import GRAVITY
from scipy.sparse.linalg import LinearOperator, cg

from porotwin_solver.flow import FaceField, Flow, transmissibilities
from porotwin_solver.physics import Physics

TOLERANCE = 1e-8
"""Relative residual of the pressure; what remains is closed exactly (see `coupled_flux`)."""


def is_coupled(physics: Physics) -> bool:
    """Return whether the flow depends on where the tracer is."""
    return physics.density_difference != 0.0 or physics.viscosity_ratio != 1.0


def coupled_flux(
    flow: Flow, physics: Physics, source: FloatArray, concentration: FloatArray
) -> FaceField:
    """Return the flux [m^3/s] that `source` (nz, nx) [m^3/s] and the tracer drive together.

    `flow` is that of pure water. Where the viscosity varies, its factor preconditions conjugate
    gradients, and the flow of water carries the small residual, so that the divergence of the
    result is `source` to round-off.
    """
    if physics.viscosity_ratio == 1.0:
        return flow.flux(source, buoyant_flux(physics, flow.transmissibility, concentration))
    conductance = (
        physics.depth
        * physics.permeability
        / (physics.viscosity * physics.viscosity_ratio**concentration)
    )
    trans = transmissibilities(physics.grid, conductance, physics.boundaries)
    driven = buoyant_flux(physics, trans, concentration)
    wanted = source - driven.divergence()
    shape = physics.grid.shape

    def outflow(pressure: FloatArray) -> FloatArray:
        return flow.pressure_flux(pressure.reshape(shape), trans).divergence().ravel()

    def pinned(pressure: FloatArray) -> FloatArray:
        result = outflow(pressure)
        result[0] += flow.pin * pressure.ravel()[0]
        return result

    size = source.size
    pressure, _ = cg(
        LinearOperator((size, size), matvec=pinned, dtype=float),
        wanted.ravel(),
        rtol=TOLERANCE,
        maxiter=200,
        M=LinearOperator((size, size), matvec=flow.solve, dtype=float),
    )
    flux = flow.pressure_flux(pressure.reshape(shape), trans) + driven
    return flux + flow.flux(source - flux.divergence())


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


def background_flux(physics: Physics, conductance: FloatArray) -> FaceField:
    """Return the flux [m^3/s] that a Darcy flux imposed on all four sides drives through the rig.

    Where the depth varies along a side, what leaves is scaled to what enters.
    """
    grid = physics.grid
    flux = FaceField.zeros(grid)
    velocity_x, velocity_z = physics.background_flux
    if velocity_x == 0.0 and velocity_z == 0.0:
        return flux
    closed = physics.boundaries.model_copy(
        update=dict.fromkeys(('top', 'bottom', 'left', 'right'), 'closed')
    )
    flux.x[:, 0] = velocity_x * grid.dz * physics.depth[:, 0]
    flux.x[:, -1] = velocity_x * grid.dz * physics.depth[:, -1]
    flux.z[0] = velocity_z * grid.dx * physics.depth[0]
    flux.z[-1] = velocity_z * grid.dx * physics.depth[-1]
    flux.x[:, -1] *= _ratio(flux.x[:, 0].sum(), flux.x[:, -1].sum())
    flux.z[-1] *= _ratio(flux.z[0].sum(), flux.z[-1].sum())
    return Flow(grid, conductance, closed).flux(np.zeros(grid.shape), flux)


def _ratio(wanted: float, given: float) -> float:
    return wanted / given if given else 1.0
