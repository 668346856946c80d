"""Maps of an image analysis: noise of the given strength, lost frames, blind spots."""

import numpy as np
import pytest
from rig_examples import make_rig

from porotwin_rig.map_camera import MapCamera, MapNoise


def test_map_noise_has_the_strength_it_says() -> None:
    grid = make_rig().default_grid()
    camera = MapCamera(grid, MapNoise(grain=0.0, frame=0.01, blur_cells=0.0), seed=3)
    field = np.full(grid.shape, 0.5)
    assert (camera.map(field, 1) - field).std() == pytest.approx(0.01 * 0.8, rel=0.02)
    grained = MapCamera(grid, MapNoise(grain=0.02, frame=0.0, blur_cells=0.0), seed=3)
    one, two = grained.map(field, 1), grained.map(field, 2)
    np.testing.assert_array_equal(one, two)
    assert (one - field).std() == pytest.approx(0.02 * 0.5, rel=0.02)


def test_noise_of_a_frame_depends_on_its_number_and_seed_alone() -> None:
    grid = make_rig().grid(40, 30)
    field = np.full(grid.shape, 0.5)
    camera = MapCamera(grid, MapNoise(), seed=3)
    fourth = camera.map(field, 4)
    camera.map(field, 2)
    np.testing.assert_array_equal(camera.map(field, 4), fourth)
    assert not np.array_equal(camera.map(field, 5), fourth)
    assert not np.array_equal(MapCamera(grid, MapNoise(), seed=4).map(field, 4), fourth)
