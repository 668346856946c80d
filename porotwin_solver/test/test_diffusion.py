"""The decomposition of the dispersion tensor into exchanges between cells."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.transport.diffusion import (
    DispersionTensor,
    Exchanges,
    diffuse,
    dispersion_tensor,
    dispersion_tensor_adjoint,
    dispersive_exchanges,
)
from porotwin_solver.transport.diffusion_kernels import (
    exchange,
    named_pairs,
    sort_pairs,
    superbase,
)
from porotwin_solver.transport.line_kernels import Lines, make_lines
from porotwin_solver.transport.local_time_steps import TimeStepLevels


@given(
    angle=st.floats(0.0, math.pi),
    anisotropy=st.floats(1.0, 1000.0),
    shape=st.floats(0.2, 5.0),
)
def test_weights_are_not_negative_and_add_up_to_the_tensor(angle, anisotropy, shape) -> None:
    cosine, sine = math.cos(angle), math.sin(angle)
    xx = (cosine**2 + sine**2 / anisotropy) * shape
    xz = cosine * sine * (1.0 - 1.0 / anisotropy)
    zz = (sine**2 + cosine**2 / anisotropy) / shape
    offset, weight = np.empty((3, 2), np.int64), np.empty(3)
    superbase(xx, xz, zz, offset, weight)
    assert (weight >= 0.0).all()
    found = np.einsum('k,ki,kj->ij', weight, offset, offset)
    np.testing.assert_allclose(found, [[xx, xz], [xz, zz]], atol=1e-9 * (xx + zz))


def flowing(rig, seed: int):
    """Return physics with dispersion, and a random flux [m^3/s]."""
    physics = replace(
        nominal_physics(rig, rig.grid(21, 15)),
        longitudinal_dispersivity=0.006,
        transverse_dispersivity=0.0005,
    )
    rng = np.random.default_rng(seed)
    flux = FaceField(rng.normal(size=(15, 22)) * 1e-6, rng.normal(size=(16, 21)) * 1e-6)
    return physics, flux


def test_the_tensor_stretches_along_the_flow(rig) -> None:
    physics, _ = flowing(rig, 1)
    grid = physics.grid
    speed = 1e-5
    flux = FaceField(
        np.full((15, 22), 0.6 * speed * 0.375 * 0.010 * grid.dz),
        np.full((16, 21), 0.8 * speed * 0.375 * 0.010 * grid.dx),
    )
    xx, xz, zz = dispersion_tensor(physics, flux)
    along = 0.36 * xx + 2 * 0.48 * xz + 0.64 * zz
    across = 0.64 * xx - 2 * 0.48 * xz + 0.36 * zz
    np.testing.assert_allclose(along, 0.006 * speed + 1e-9, rtol=1e-12)
    np.testing.assert_allclose(across, 0.0005 * speed + 1e-9, rtol=1e-12)


def test_diffusion_is_conservative_and_bounded_and_preserves_constants(rig) -> None:
    physics, flux = flowing(rig, 2)
    exchanges = dispersive_exchanges(physics, flux, 60.0)
    assert len(exchanges.levels.count_at_least) > 3, 'the cells should differ in level'
    field = np.random.default_rng(3).integers(0, 2, (15, 21)).astype(float)
    before = math.fsum((physics.storage * field).ravel())
    diffuse(field, physics.storage, exchanges)
    assert math.fsum((physics.storage * field).ravel()) == pytest.approx(before, rel=1e-14)
    assert 0.0 <= field.min() < field.max() <= 1.0
    constant = np.full((15, 21), 0.3)
    diffuse(constant, physics.storage, exchanges)
    assert (constant == 0.3).all()


@given(
    seed=st.integers(0, 10**6),
    along=st.floats(0.0, 0.2),
    across=st.floats(0.0, 0.2),
    duration=st.floats(1.0, 3e4),
    steps=st.integers(1, 3),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_exchange_along_lines_makes_no_new_extreme_and_no_tracer(
    rig, seed, along, across, duration, steps
) -> None:
    """Whatever the flow, the dispersion and the length of a step: the step may be far too long."""
    physics, flux = flowing(rig, seed)
    rng = np.random.default_rng(seed)
    physics = replace(
        physics,
        longitudinal_dispersivity=along,
        transverse_dispersivity=across,
        porosity=rng.uniform(0.1, 0.5, (15, 21)),
    )
    exchanges = along_lines(physics, flux, duration, steps)
    field = rng.integers(0, 2, (15, 21)) * rng.choice([1.0, 1e-9])
    low, high = field.min(), field.max()
    before = math.fsum((physics.storage * field).ravel())
    diffuse(field, physics.storage, exchanges)
    # each substep rounds the volumes that a cell exchanges; they are `moved` times its storage
    moved = steps * float(np.max(exchanges.weight.max() * duration / physics.storage))
    slack = 1e-14 * (1.0 + moved) * high
    assert low - slack <= field.min()
    assert field.max() <= high + slack
    assert math.fsum((physics.storage * field).ravel()) == pytest.approx(before, rel=1e-13)


def along_lines(physics, flux, duration: float, steps: int):
    """Return the exchanges along lines in any case, with so many substeps."""
    grid = physics.grid
    scales = (1.0 / grid.dx**2, 1.0 / (grid.dx * grid.dz), 1.0 / grid.dz**2)
    tensor = dispersion_tensor(physics, flux)
    scaled = DispersionTensor(*(part * scale for part, scale in zip(tensor, scales, strict=True)))
    level = np.zeros(physics.storage.shape, np.int8)
    pairs = sort_pairs(*named_pairs(scaled, physics.mobile_water)[:-1], level.ravel())
    lines = Lines(steps, *make_lines(*pairs, physics.storage.ravel(), duration / steps))
    order, count = np.arange(level.size, dtype=np.int32), np.array([level.size])
    levels = TimeStepLevels(duration, level, order, count)
    return Exchanges(levels, *pairs, lines=lines)


def test_the_tensor_and_its_adjoint_pass_the_dot_product_test(rig) -> None:
    physics, flux = flowing(rig, 4)
    _, direction = flowing(rig, 5)
    rng = np.random.default_rng(6)
    bar = DispersionTensor(*rng.normal(size=(3, 15, 21)))
    step = 1e-5
    more = dispersion_tensor(physics, flux + direction * step)
    less = dispersion_tensor(physics, flux + direction * -step)
    forward = sum(
        np.vdot(by, (up - down) / (2 * step)) for by, up, down in zip(bar, more, less, strict=True)
    )
    back = dispersion_tensor_adjoint(physics, flux, bar)
    backward = np.vdot(back.x, direction.x) + np.vdot(back.z, direction.z)
    assert backward == pytest.approx(forward, rel=1e-8)


@pytest.mark.parametrize('shape', [(15, 21), (1, 21), (15, 1)])
def test_pairs_of_neighbours_are_those_of_the_tensor_to_the_last_bit(make_rig, shape) -> None:
    rig = make_rig(porosity=0.3)
    physics = nominal_physics(rig, rig.grid(shape[1], shape[0]))
    physics = replace(physics, porosity=np.random.default_rng(1).uniform(0.2, 0.4, shape))
    quick = dispersive_exchanges(physics, FaceField.zeros(physics.grid), 30.0)
    assert quick.to_neighbours
    tensor = dispersion_tensor(physics, FaceField.zeros(physics.grid))
    scaled = DispersionTensor(
        tensor.xx / physics.grid.dx**2, tensor.xz, tensor.zz / physics.grid.dz**2
    )
    named = named_pairs(scaled, physics.mobile_water)
    found = sort_pairs(*named[:-1], quick.levels.level.ravel())
    for one, other in zip(quick[1:4], found, strict=True):
        np.testing.assert_array_equal(one, other)
    c = np.zeros(shape)
    c.flat[7:12] = np.random.default_rng(2).uniform(size=5)
    one, other = c.copy(), c.copy()
    for _ in range(3):
        diffuse(one, physics.storage, quick)
        exchange(other.ravel(), physics.storage.ravel(), quick, np.empty(0))
    np.testing.assert_array_equal(one, other)
    assert (one != c).any()


def test_water_at_rest_without_diffusion_exchanges_nothing(rig) -> None:
    physics, _ = flowing(rig, 1)
    physics = replace(physics, diffusion=0.0)
    found = dispersive_exchanges(physics, FaceField.zeros(physics.grid), 60.0)
    assert found.weight.sum() < 1e-300
    field = np.random.default_rng(1).random((15, 21))
    before = field.copy()
    diffuse(field, physics.storage, found)
    np.testing.assert_array_equal(field, before)


def test_a_strong_diffusion_takes_several_steps(rig) -> None:
    physics = replace(nominal_physics(rig, rig.grid(21, 15)), model_diffusion=1e-4)
    found = dispersive_exchanges(physics, FaceField.zeros(physics.grid), 60.0)
    assert not found.to_neighbours
    assert found.lines is not None
    assert found.lines.steps > 1
