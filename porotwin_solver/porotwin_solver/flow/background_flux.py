"""Water that moves without the wells: a flux through all sides, between water bodies, or rain."""

from functools import reduce
from operator import add

import numpy as np

from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.water_contact import contact_of, outer_flux
from porotwin_solver.flow.flow import SHARED_FLOWS


def background_flux(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] that moves without the wells; None if there is none."""
    parts = [_through_all_sides(physics), _of_water(physics)]
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
    flux.x[:, 0] = velocity_x * grid.dz * physics.depth[:, 0]
    flux.x[:, -1] = velocity_x * grid.dz * physics.depth[:, -1]
    flux.z[0] = velocity_z * grid.dx * physics.depth[0]
    flux.z[-1] = velocity_z * grid.dx * physics.depth[-1]
    flux.x[:, -1] *= _ratio(flux.x[:, 0].sum(), flux.x[:, -1].sum())
    flux.z[-1] *= _ratio(flux.z[0].sum(), flux.z[-1].sum())
    flow = SHARED_FLOWS.flow(grid, physics.mobility_thickness, contact_of(grid, {}))
    return flow.flux(np.zeros(grid.shape), flux)


def _of_water(physics: Physics) -> FaceField | None:
    """Return the flux [m^3/s] that heads, a tilted table and rain drive; None without these."""
    flow = SHARED_FLOWS.flow(physics.grid, physics.mobility_thickness, physics.contact)
    driven = driven_by_water(physics, flow.transmissibility)
    return None if driven is None else flow.flux(np.zeros(physics.grid.shape), driven)


def driven_by_water(physics: Physics, trans: FaceField) -> FaceField | None:
    """Return the flux [m^3/s] of `side_flux`, and of water that enters at a given rate."""
    by_heads, rain = side_flux(physics, trans), physics.contact.rain
    if not any(side.any() for side in rain):
        return by_heads
    entering = outer_flux(rain)
    return entering if by_heads is None else by_heads + entering


def side_flux(physics: Physics, trans: FaceField) -> FaceField | None:
    """Return the flux [m^3/s] that the potential of the water drives into the sand.

    It is T p on the faces to open water, with the transmissibility T [m^3/(s Pa)] and the potential
    p [Pa]. None where p is zero everywhere.
    """
    potentials = physics.water_potentials
    if potentials is None:
        return None
    outer, inner = potentials
    flux = outer_flux(outer)
    if physics.contact.canal is not None:
        flux.x[:, 1:-1] = inner[:, :-1] - inner[:, 1:]
        flux.z[1:-1] = inner[:-1] - inner[1:]
    return flux * trans


def _ratio(inflow: float, outflow: float) -> float:
    return inflow / outflow if outflow else 1.0
