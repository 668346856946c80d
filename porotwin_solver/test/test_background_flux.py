"""The flux that is imposed on all four sides."""

from dataclasses import replace

import numpy as np

from porotwin_solver.background_flux import background_flux
from porotwin_solver.physics import nominal_physics


def test_the_background_flux_is_uniform_in_a_homogeneous_rig(rig) -> None:
    physics = nominal_physics(rig, rig.grid(31, 17))
    physics = replace(physics, background_flux=(2e-6, -1e-6))
    flux = background_flux(physics)
    np.testing.assert_allclose(flux.x, 2e-6 * 0.010 * physics.grid.dz, rtol=1e-10)
    np.testing.assert_allclose(flux.z, -1e-6 * 0.010 * physics.grid.dx, rtol=1e-10)


def test_without_a_background_flux_there_is_none(rig) -> None:
    assert background_flux(nominal_physics(rig, rig.grid(31, 17))) is None


def test_water_flows_from_the_higher_end_of_the_table_to_the_lower_one(rig) -> None:
    physics = nominal_physics(rig, rig.grid(31, 17))
    flux = background_flux(replace(physics, table_tilt=10.0))
    np.testing.assert_allclose(flux.divergence(), 0.0, atol=1e-18)
    through = flux.z[-1]
    np.testing.assert_allclose(through, -through[::-1], atol=1e-18)
    assert through[-1] < 0.0 < through[0]  # it enters on the right, where the table is higher
    assert (flux.x[:, 15] < 0.0).all()
    closed = physics.boundaries.model_copy(update={'top': 'closed'})
    assert background_flux(replace(physics, table_tilt=10.0, boundaries=closed)) is None
