"""The flux that is imposed on all four sides, or driven by the heads of open sides."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.basis.units import GRAVITY
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.model.coupling import Coupling
from porotwin_solver.model.engine import Engine
from porotwin_solver.transport.transport import Scheme


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


BETWEEN = {
    'top': 'closed',
    'left': 'open',
    'right': 'open',
    'heads_m': {'left': 0.62, 'right': 0.6},
}
"""Water flows from left to right below a head that falls by 2 cm."""


def test_the_flux_between_two_heads_follows_darcys_law(make_rig) -> None:
    rig = make_rig(boundaries=BETWEEN)
    physics = nominal_physics(rig, rig.grid(31, 17))
    flux = background_flux(physics)
    conductivity = 6.57e-10 * 998.0 * GRAVITY / 1e-3
    through_a_row = conductivity * 0.02 / 0.934 * 0.010 * physics.grid.dz
    np.testing.assert_allclose(flux.x, through_a_row, rtol=1e-9)
    np.testing.assert_allclose(flux.z, 0.0, atol=1e-9 * through_a_row)


def test_layers_carry_water_in_proportion_to_their_permeability(make_rig) -> None:
    rig = make_rig(boundaries=BETWEEN)
    physics = nominal_physics(rig, rig.grid(31, 17))
    layered = physics.permeability.copy()
    layered[5:9] *= 4.0
    flux = background_flux(replace(physics, permeability=layered))
    np.testing.assert_allclose(flux.x[6] / flux.x[0], 4.0, rtol=1e-9)


def test_only_the_difference_of_heads_matters(make_rig) -> None:
    lower = BETWEEN | {'heads_m': {'left': 0.02, 'right': 0.0}}
    first, second = (
        background_flux(nominal_physics(rig, rig.grid(31, 17)))
        for rig in (make_rig(boundaries=BETWEEN), make_rig(boundaries=lower))
    )
    np.testing.assert_allclose(first.x, second.x, rtol=1e-9)
    equal = make_rig(boundaries=BETWEEN | {'heads_m': {'left': 0.5, 'right': 0.5}})
    assert background_flux(nominal_physics(equal, equal.grid(31, 17))) is None


def test_a_viscous_tracer_slows_the_flux_between_heads(make_rig) -> None:
    rig = make_rig(boundaries=BETWEEN)
    physics = replace(nominal_physics(rig, rig.grid(31, 17)), viscosity_ratio=2.0)
    engine = Engine(physics, scheme=Scheme.UPWIND)
    water = engine.water_flux({})
    slow = engine.coupled_flux(water, {}, np.ones(physics.grid.shape))
    np.testing.assert_allclose(slow.x, 0.5 * water.x, rtol=1e-6)


def test_a_viscous_tracer_between_heads_has_the_right_adjoint(make_rig) -> None:
    rig = make_rig(boundaries=BETWEEN)
    physics = replace(
        nominal_physics(rig, rig.grid(12, 7)), viscosity_ratio=0.5, density_difference=2.0
    )
    coupling, random = Coupling(physics), np.random.default_rng(2)
    concentration, direction = random.random((2, *physics.grid.shape))
    bar = FaceField(random.random((7, 13)), random.random((8, 12)))

    def cost(step: float) -> float:
        flux = coupling.flux({}, concentration + step * direction)
        return float((flux.x * bar.x).sum() + (flux.z * bar.z).sum())

    by_concentration, _ = coupling.flux_adjoint({}, concentration, bar)
    slope = (cost(1e-4) - cost(-1e-4)) / 2e-4
    assert float((by_concentration * direction).sum()) == pytest.approx(slope, rel=1e-5)
