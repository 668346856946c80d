"""Water that moves without the wells: a flux through all four sides, or below a tilted table."""

from functools import reduce
from operator import add

import numpy as np

from porotwin_solver.face_field import FaceField
from porotwin_solver.flow import SHARED_FLOWS
from porotwin_solver.physics import Physics


def background_flux(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] that moves without the wells; None if there is none."""
    parts = [_through_all_sides(physics), _below_a_tilted_table(physics)]
    moving = [part for part in parts if part is not None]
    return reduce(add, moving) if moving else None


def _through_all_sides(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] that `physics.background_flux` [m/s] drives; None where it is zero.

    Where the depth differs between opposite sides, the outflow is scaled to the inflow.
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
    flow = SHARED_FLOWS.flow(grid, physics.mobility_thickness, closed)
    return flow.flux(np.zeros(grid.shape), flux)


def _below_a_tilted_table(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] below a tilted water table; None where nothing tilts.

    With the tilt t [Pa], the pressure on the open upper side is t (x / W - 1/2).
    """
    if physics.table_tilt == 0.0 or physics.boundaries.top != 'open':
        return None
    grid = physics.grid
    flow = SHARED_FLOWS.flow(grid, physics.mobility_thickness, physics.boundaries)
    pressure = physics.table_tilt * (grid.x / grid.width - 0.5)
    flux = FaceField.zeros(grid)
    flux.z[-1] = -flow.transmissibility.z[-1] * pressure
    return flow.flux(np.zeros(grid.shape), flux)


def _ratio(inflow: float, outflow: float) -> float:
    return inflow / outflow if outflow else 1.0
