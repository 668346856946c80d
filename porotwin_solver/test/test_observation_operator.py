"""The map that the camera shows of a concentration."""

import math

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.simulation import simulate

GRID = Grid(93, 56, 0.934, 0.562)


def spot(x: float, z: float, width: float = 0.05) -> np.ndarray:
    """Return a round smooth spot on GRID."""
    return np.exp(-((GRID.x[None, :] - x) ** 2 + (GRID.z[:, None] - z) ** 2) / (2 * width**2))


def test_a_point_appears_at_its_registered_place() -> None:
    """p appears at C + scale R(rotation) (p - C) + (dx, dz)."""
    operator = ObservationOperator(dx=0.02, dz=-0.01, rotation=0.3, scale=1.1)
    shown = operator.apply(spot(0.6, 0.3), GRID, 0.0)
    x, z = 0.6 - 0.467, 0.3 - 0.281
    expected_x = 0.467 + 1.1 * (math.cos(0.3) * x - math.sin(0.3) * z) + 0.02
    expected_z = 0.281 + 1.1 * (math.sin(0.3) * x + math.cos(0.3) * z) - 0.01
    assert (shown * GRID.x).sum() / shown.sum() == pytest.approx(expected_x, abs=2e-3)
    assert (shown * GRID.z[:, None]).sum() / shown.sum() == pytest.approx(expected_z, abs=2e-3)


def test_two_registrations_combine_to_one() -> None:
    """Two diagnoses, one after the other, may each add a registration to a rig description."""
    first = {'dx': 0.02, 'dz': -0.01, 'rotation': 0.3, 'scale': 1.1}
    second = {'dx': -0.005, 'dz': 0.015, 'rotation': -0.1, 'scale': 0.95}
    move = EFFECTS['registration'].on_observation
    assert move is not None
    shown = spot(0.6, 0.3)
    for values in (first, second):
        shown = move(ObservationOperator(), values).apply(shown, GRID, 0.0)
    both = move(move(ObservationOperator(), first), second).apply(spot(0.6, 0.3), GRID, 0.0)
    np.testing.assert_allclose(both, shown, atol=0.02)
    assert abs(both - spot(0.6, 0.3)).max() > 0.3


def test_the_values_at_the_edge_continue_beyond_the_rig() -> None:
    shown = ObservationOperator(dx=0.05).apply(np.ones(GRID.shape), GRID, 0.0)
    np.testing.assert_allclose(shown, 1.0)


def test_saturation_is_a_power_and_illumination_a_clipped_factor() -> None:
    field = np.full(GRID.shape, 0.25)
    np.testing.assert_allclose(ObservationOperator(exponent=0.5).apply(field, GRID, 0.0), 0.5)
    lit = ObservationOperator(drift=1e-3, gradient=2.0).apply(field, GRID, 500.0)
    np.testing.assert_allclose(lit[0], 0.25 * (1.5 + 2.0 * (GRID.x - 0.467)))
    assert ObservationOperator(drift=1.0).apply(field, GRID, 500.0).max() == 1.0


def test_the_clock_offset_shifts_the_pump_time(rig, rates) -> None:
    grid = rig.grid(31, 19)
    schedule = Schedule.constant(rates)
    late = [EffectDescription(name='clock', parameters={'offset': 60.0})]
    early = [EffectDescription(name='clock', parameters={'offset': -60.0})]
    true = simulate(rig, schedule, [0.0, 60.0, 120.0], grid=grid, preset='fast')
    ahead = simulate(rig, schedule, [0.0, 60.0], grid=grid, preset='fast', effects=late)
    behind = simulate(rig, schedule, [0.0, 60.0, 120.0], grid=grid, preset='fast', effects=early)
    np.testing.assert_array_equal(ahead, true[1:])
    np.testing.assert_array_equal(behind, [true[0], true[0], true[1]])


def test_the_operator_and_its_adjoint_pass_the_dot_product_test() -> None:
    operator = ObservationOperator(
        exponent=1.4, drift=-1e-4, gradient=0.3, dx=0.004, rotation=0.02, scale=1.03
    )
    rng = np.random.default_rng(2)
    field, direction = 0.2 + 0.5 * rng.random((112, 186)), rng.normal(size=(112, 186))
    bar = rng.normal(size=GRID.shape)
    step = 1e-6
    more = operator.apply(field + step * direction, GRID, 900.0)
    less = operator.apply(field - step * direction, GRID, 900.0)
    forward = np.vdot(bar, (more - less) / (2.0 * step))
    backward = np.vdot(operator.apply_adjoint(field, GRID, 900.0, bar), direction)
    assert backward == pytest.approx(forward, rel=1e-7)


def test_effects_of_the_rig_act_like_given_ones(make_rig, rates) -> None:
    effect = EffectDescription(name='porosity', parameters={'factor': 0.9})
    own, given = make_rig(effects=(effect,)), make_rig()
    grid, schedule = own.grid(31, 19), Schedule.constant(rates)
    np.testing.assert_array_equal(
        simulate(own, schedule, [90.0], grid=grid, preset='fast'),
        simulate(given, schedule, [90.0], grid=grid, preset='fast', effects=[effect]),
    )
