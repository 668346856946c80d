"""The bow of the dark frame along the edges of the described rig."""

import numpy as np
import pytest

from porotwin_imaging.baseline.sand_edges import sand_edges

ROWS, COLUMNS = 200, 360


def frame(depth: np.ndarray, side: str) -> np.ndarray:
    """Return a mask with a frame of `depth` rows along one side."""
    unlit = np.zeros((ROWS, COLUMNS), bool)
    unlit |= np.arange(ROWS)[:, None] < depth
    return unlit[::-1] if side == 'lower' else unlit


@pytest.mark.parametrize('side', ['upper', 'lower'])
def test_a_bent_edge_is_measured(side) -> None:
    position = np.linspace(-1, 1, COLUMNS)
    bows = {one.side: one.bow for one in sand_edges(frame(6 * (1 - position**2), side))}
    assert bows[side] == pytest.approx(6 / ROWS, rel=0.2)
    assert bows['left'] == pytest.approx(0, abs=2e-3)


def test_a_straight_or_a_slanting_frame_is_not_bent() -> None:
    for depth in (np.zeros(COLUMNS), np.full(COLUMNS, 5.0), np.linspace(0, 8, COLUMNS)):
        assert all(abs(one.bow) < 3e-3 for one in sand_edges(frame(depth, 'lower')))


def test_a_side_in_the_dark_has_no_edge() -> None:
    unlit = np.zeros((ROWS, COLUMNS), bool)
    unlit[-60:] = True
    assert 'lower' not in {one.side for one in sand_edges(unlit)}
