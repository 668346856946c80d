"""The fuzzy mask and the cost of a tracer distribution."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.grid import Grid
from porotwin_core.rig import parse_rig
from porotwin_hub.objective import Objective, distance_to_polygon, fuzzy_mask

SQUARE = np.array([[0.2, 0.2], [0.6, 0.2], [0.6, 0.6], [0.2, 0.6]])
L_SHAPE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.4, 0.3], [0.4, 1.0], [0.0, 1.0]])


def test_distances_to_a_square_are_known() -> None:
    points = np.array([[0.4, 0.4], [0.4, 0.7], [0.7, 0.7], [0.2, 0.3], [0.0, 0.4]])
    expected = [0.0, 0.1, np.hypot(0.1, 0.1), 0.0, 0.2]
    np.testing.assert_allclose(distance_to_polygon(points, SQUARE), expected, atol=1e-12)


def test_a_notch_of_a_concave_zone_is_outside() -> None:
    assert distance_to_polygon(np.array([[0.7, 0.7]]), L_SHAPE) == pytest.approx(0.3)


@given(x=st.floats(-1, 2), z=st.floats(-1, 2), turn=st.integers(0, 3))
def test_the_outline_may_start_at_any_corner(x: float, z: float, turn: int) -> None:
    point = np.array([[x, z]])
    rolled = np.roll(L_SHAPE, turn, axis=0)
    np.testing.assert_allclose(
        distance_to_polygon(point, rolled), distance_to_polygon(point, L_SHAPE), atol=1e-12
    )


def test_the_mask_falls_from_one_to_zero_over_the_fuzziness() -> None:
    grid = Grid(100, 100, 1.0, 1.0)
    mask = fuzzy_mask(SQUARE, grid, 0.1)
    assert mask.min() == 0.0
    assert mask.max() == 1.0
    row = mask[40]
    assert (row[20:60] == 1.0).all()
    assert row[65] == pytest.approx(0.5, abs=0.1)
    assert (row[71:] == 0.0).all()
    assert (np.diff(row[59:71]) < 0).all()


def test_the_cost_of_a_full_zone_is_its_pore_volume() -> None:
    rig = parse_rig(
        {
            'name': 'unit',
            'width_m': 1.0,
            'height_m': 1.0,
            'depth_m': 0.01,
            'porosity': 0.4,
            'permeability_m2': 1e-9,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'wells': {'a': {'x_m': 0.5, 'z_m': 0.5}},
            'control': {'wells': ['a'], 'disallowed_zone_m': SQUARE.tolist(), 'fuzziness_m': 0.0},
        },
        Path('rig.yaml'),
    )
    grid = rig.grid(50, 50)
    objective = Objective(rig, grid)
    assert objective(np.ones(grid.shape)) == pytest.approx(0.16 * 0.01 * 0.4)
    unseen = np.full(grid.shape, np.nan)
    assert objective(unseen) == 0.0
