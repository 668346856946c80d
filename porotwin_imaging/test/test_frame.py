"""Sand outside the frame has no value, and costs no accuracy elsewhere."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.geometry.frame import frame_remarks, in_frame
from porotwin_imaging.geometry.sampling import Sampling
from porotwin_imaging.photo_to_map import concentration_map


@pytest.mark.parametrize('shift', [(60.0, 0.0), (-64.0, 48.0), (0.0, 170.0)])
def test_sand_outside_the_frame_is_unknown(
    baseline, laboratory, true_map, relative_error, shift: tuple[float, float]
) -> None:
    still = concentration_map(laboratory.photograph(true_map), baseline)
    found = concentration_map(laboratory.photograph(true_map, shift=shift), baseline)
    assert relative_error(found.values, true_map) < relative_error(still.values, true_map) + 0.01
    assert found.alignment.shift == pytest.approx(np.hypot(*shift), abs=1.0)


def test_the_edge_of_the_frame_is_no_tracer(baseline, laboratory, no_tracer) -> None:
    found = concentration_map(laboratory.photograph(no_tracer, shift=(-80.0, 0.0)), baseline)
    assert any('% of the sand has left the frame: unknown' in line for line in found.status)
    assert found.suspicious
    assert np.isnan(found.values[:, :3]).all()
    assert np.nanmax(found.values) < 0.05


def small_sampling() -> Sampling:
    rows, columns = np.mgrid[10.0:20.0, 10.0:30.0].astype(np.float32)
    return Sampling(Grid(4, 2, 0.4, 0.2), 5, columns, rows)


def test_a_picture_inside_the_frame_needs_no_mask() -> None:
    assert in_frame(small_sampling(), np.eye(3), (40, 40, 3)) is None


def test_the_mask_follows_the_camera() -> None:
    moved = np.eye(3)
    moved[0, 2] = 15.0
    inside = in_frame(small_sampling(), moved, (40, 40, 3))
    assert inside is not None
    assert inside[:, :15].all()
    assert not inside[:, 15:].any()


def test_a_photograph_of_little_sand_is_refused() -> None:
    share = np.ones((2, 4))
    assert frame_remarks(share, share) == []
    framed = share * [1, 1, 1, 0]
    assert frame_remarks(share, framed) == ['25.0 % of the sand has left the frame: unknown']
    with pytest.raises(InputError, match='photograph does not show 50 % of the sand'):
        frame_remarks(share, share * [1, 1, 0, 0])
