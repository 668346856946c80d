"""Water that moves without the wells: a flux through all four sides, or between open sides."""

from functools import reduce
from operator import add

import numpy as np

from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.flow.flow import SHARED_FLOWS


def background_flux(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] that moves without the wells; None if there is none."""
    parts = [_through_all_sides(physics), _between_open_sides(physics)]
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


def _between_open_sides(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] that heads and a tilted water table drive; None without these."""
    if not physics.has_side_potential:
        return None
    flow = SHARED_FLOWS.flow(physics.grid, physics.mobility_thickness, physics.boundaries)
    driven = side_flux(physics, flow.transmissibility)
    return None if driven is None else flow.flux(np.zeros(physics.grid.shape), driven)


def side_flux(physics: Physics, trans: FaceField) -> FaceField | None:
    """Return the flux [m^3/s] that the potential beyond open sides drives through them.

    It is +-T p on the faces of an open side, with the transmissibility T [m^3/(s Pa)] and the
    potential p [Pa]. With the tilt t [Pa], p on an open upper side also has t (x / W - 1/2).
    None where p is zero everywhere.
    """
    if not physics.has_side_potential:
        return None
    grid, potentials = physics.grid, physics.side_potentials
    flux = FaceField.zeros(grid)
    top = potentials.get('top', 0.0) + physics.table_tilt * (grid.x / grid.width - 0.5)
    flux.x[:, 0] = trans.x[:, 0] * potentials.get('left', 0.0)
    flux.x[:, -1] = -trans.x[:, -1] * potentials.get('right', 0.0)
    flux.z[0] = trans.z[0] * potentials.get('bottom', 0.0)
    flux.z[-1] = -trans.z[-1] * top
    return flux


def _ratio(inflow: float, outflow: float) -> float:
    return inflow / outflow if outflow else 1.0
