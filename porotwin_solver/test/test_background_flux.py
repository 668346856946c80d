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
