"""Sampling points, and how coarsely a photograph is decoded."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Camera
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.geometry.sampling import Sampling, choose_reduction


@pytest.fixture
def geometry() -> Geometry:
    corners = ((0, 0), (0, 4000), (8000, 4000), (8000, 0))
    return Geometry.from_camera(Camera(corners_px=corners), 2.0, 1.0)


@pytest.mark.parametrize(('columns', 'reduction'), [(100, 4), (2500, 2), (6000, 1)])
def test_a_fine_map_needs_a_fine_decoding(laboratory, geometry, columns, reduction) -> None:
    grid = laboratory.rig.grid(columns, columns // 2)
    assert choose_reduction(geometry, grid, 8000) == reduction


def test_cell_means_have_row_zero_at_the_bottom(baseline) -> None:
    sampling: Sampling = baseline.sampling
    rows = np.arange(sampling.shape[0], dtype=np.float32)[:, None]
    means = sampling.cell_means(np.broadcast_to(rows, sampling.shape).copy())
    assert means.shape == sampling.grid.shape
    assert (np.diff(means[:, 0]) < 0).all()


def test_sampling_points_are_the_pixels_of_the_cells(baseline) -> None:
    sampling: Sampling = baseline.sampling
    rows, columns = np.indices((640, 890), np.float32)
    np.testing.assert_allclose(sampling.sample(columns), sampling.columns, atol=0.02)
    np.testing.assert_allclose(sampling.sample(rows), sampling.rows, atol=0.02)


def test_the_size_of_a_cell_is_counted_in_decoded_pixels(geometry) -> None:
    sampling = Sampling.of(geometry, Grid(100, 40, 2.0, 1.0), 4)
    np.testing.assert_allclose(sampling.pixels_per_cell, (25.0, 20.0), rtol=0.01)
