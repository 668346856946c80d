"""A uniform Darcy flux imposed on all four sides of the rig, beside the wells."""

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_solver.flow import FaceField, flow_of
from porotwin_solver.physics import Physics


def background_flux(physics: Physics, conductance: FloatArray) -> FaceField | None:
    """Return the flux [m^3/s] that a Darcy flux imposed on all four sides drives, None without one.

    Where the depth varies along a side, what leaves is scaled to what enters.
    """
    velocity_x, velocity_z = physics.background_flux
    if velocity_x == 0.0 and velocity_z == 0.0:
        return None
    grid = physics.grid
    flux = FaceField.zeros(grid)
    closed = physics.boundaries.model_copy(
        update=dict.fromkeys(('top', 'bottom', 'left', 'right'), 'closed')
    )
    flux.x[:, 0] = velocity_x * grid.dz * physics.depth[:, 0]
    flux.x[:, -1] = velocity_x * grid.dz * physics.depth[:, -1]
    flux.z[0] = velocity_z * grid.dx * physics.depth[0]
    flux.z[-1] = velocity_z * grid.dx * physics.depth[-1]
    flux.x[:, -1] *= _ratio(flux.x[:, 0].sum(), flux.x[:, -1].sum())
    flux.z[-1] *= _ratio(flux.z[0].sum(), flux.z[-1].sum())
    return flow_of(grid, conductance, closed).flux(np.zeros(grid.shape), flux)


def _ratio(wanted: float, given: float) -> float:
    return wanted / given if given else 1.0
