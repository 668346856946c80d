"""Tests of measured depths: exact at the points, linear between them, steady beyond them."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig.depth_points import depth_map, interpolated, read_depth_points


def test_a_plane_is_found_again_inside_and_kept_beyond() -> None:
    corners = np.array([[0.2, 0.1], [0.8, 0.1], [0.2, 0.5], [0.8, 0.5]])
    points = np.column_stack([corners, 0.01 + 0.01 * corners[:, 0]])
    depth = depth_map(points, 1.0, 0.6)
    assert depth.shape == (60, 100)
    assert depth[30, 50] == pytest.approx(0.01 + 0.01 * 0.505)
    assert depth.min() == pytest.approx(0.012)
    assert depth.max() == pytest.approx(0.018)


@pytest.mark.parametrize(
    ('points', 'expected'),
    [
        ([[0.5, 0.3, 0.02]], [0.02, 0.02]),
        ([[0.0, 0.3, 0.01], [1.0, 0.3, 0.03]], [0.015, 0.03]),
        ([[0.0, 0.3, 0.01], [1.0, 0.3, 0.03], [2.0, 0.3, 0.03]], [0.015, 0.03]),
    ],
)
def test_points_on_a_line_are_interpolated_along_it(
    points: list[list[float]], expected: list[float]
) -> None:
    places = np.array([[0.25, 0.9], [1.5, 0.0]])
    found = interpolated(np.array(points), places)
    np.testing.assert_allclose(found, expected)


def test_a_table_of_points_is_read(tmp_path: Path) -> None:
    path = tmp_path / 'depth.csv'
    path.write_text('\ufeffx_m,z_m,depth_m\r\n0,0,0.019\r\n\r\n0.2,0,0.0192\r\n')
    assert read_depth_points(path) == ((0.0, 0.0, 0.019), (0.2, 0.0, 0.0192))


@pytest.mark.parametrize(
    ('text', 'named'), [('x,z,d\n', 'first line'), ('x_m,z_m,depth_m\n0;0;1\n', r'depth\.csv:2')]
)
def test_a_wrong_table_is_refused(text: str, named: str, tmp_path: Path) -> None:
    (tmp_path / 'depth.csv').write_text(text)
    with pytest.raises(InputError, match=named):
        read_depth_points(tmp_path / 'depth.csv')
