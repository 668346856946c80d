"""The flow of a well through homogeneous sand."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_costa.data.flow_shape import homogeneous_flow

GRID = Grid(23, 14, 0.9, 0.5)
WELLS = {'a': (0.21, 0.11), 'b': (0.7, 0.3)}


def _outflow(right: np.ndarray, up: np.ndarray) -> np.ndarray:
    outflow = np.zeros(GRID.shape)
    outflow[:, :-1] += right
    outflow[:, 1:] -= right
    outflow[:-1] += up
    outflow[1:] -= up
    return outflow


def _source(place: tuple[float, float]) -> np.ndarray:
    source = np.zeros(GRID.shape)
    source[int(place[1] / GRID.dz), int(place[0] / GRID.dx)] = 1.0
    return source


@pytest.mark.parametrize(
    'boundaries',
    [
        Boundaries(),
        Boundaries(top='closed', bottom='open'),
        Boundaries(bottom='open'),
        Boundaries(left='open', right='open', top='closed'),
    ],
)
def test_injected_water_leaves_through_the_open_sides_only(boundaries):
    flow = homogeneous_flow(GRID, WELLS, boundaries)
    inner = np.ones(GRID.shape, bool)
    inner[-1] &= boundaries.top == 'closed'
    inner[0] &= boundaries.bottom == 'closed'
    inner[:, 0] &= boundaries.left == 'closed'
    inner[:, -1] &= boundaries.right == 'closed'
    for number, place in enumerate(WELLS.values()):
        balance = _outflow(flow.right[number], flow.up[number]) - _source(place)
        assert np.abs(balance[inner]).max() < 1e-12  # round-off of a few hundred additions
        assert balance.sum() == pytest.approx(-1.0, abs=1e-12)


def test_a_closed_rig_conserves_balanced_rates_in_every_cell():
    flow = homogeneous_flow(GRID, WELLS, Boundaries(top='closed'))
    balance = _outflow(flow.right[0] - flow.right[1], flow.up[0] - flow.up[1])
    wanted = _source(WELLS['a']) - _source(WELLS['b'])
    assert np.abs(balance - wanted).max() < 1e-12


def test_flow_is_irrotational():
    flow = homogeneous_flow(GRID, WELLS, Boundaries())
    right, up = flow.right / (GRID.dz / GRID.dx), flow.up / (GRID.dx / GRID.dz)
    around = right[:, :-1, :] - right[:, 1:, :] + up[:, :, 1:] - up[:, :, :-1]
    assert np.abs(around).max() < 1e-12


def test_far_from_walls_flow_falls_with_distance_as_around_a_line_source():
    grid = Grid(101, 101, 1.0, 1.0)
    flow = homogeneous_flow(grid, {'a': (0.5, 0.5)}, Boundaries(top='closed'))
    for cells in (10, 20):
        expected = 1 / (2 * np.pi * (cells + 0.5))
        # the even loss over a closed rig reduces the flow through the circle
        expected *= 1 - np.pi * (cells + 0.5) ** 2 / 101**2
        assert flow.right[0, 50, 50 + cells] == pytest.approx(expected, rel=0.02)
