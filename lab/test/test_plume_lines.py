"""Tips and centre lines of plumes, on maps of known shape."""

import numpy as np
import pytest

from lab.photographs.plume_lines import line_error, plume_lines, without_holes
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig


def drawn(rig, grid, length: float, drop: float) -> np.ndarray:
    """Return a map with a straight plume to the right of the injector."""
    well = rig.wells['injector']
    x, z = np.meshgrid(grid.x, grid.z)
    along = x - well.x_m
    inside = (along > 0) & (along < length) & (np.abs(z - well.z_m + drop * along) < 0.02)
    return inside.astype(float)


def test_a_longer_and_higher_plume_is_ahead_and_above() -> None:
    rig = load_rig(small_rig())
    grid = rig.default_grid()
    well = rig.wells['injector']
    seen = plume_lines(drawn(rig, grid, 0.2, 0.2), rig, grid)['injector']
    ahead = plume_lines(drawn(rig, grid, 0.3, 0.0), rig, grid)['injector']
    error = line_error(ahead, seen, (well.x_m, well.z_m))
    assert error.ahead == pytest.approx(0.1, abs=0.01)
    assert error.above == pytest.approx(0.02, abs=0.005)
    assert error.line == pytest.approx(error.above)


def test_small_holes_are_filled_and_wide_ones_are_empty() -> None:
    values = np.ones((40, 60))
    values[10:14, 10:14] = np.nan
    values[:, 30:] = np.nan
    filled = without_holes(values)
    assert filled[10:14, 10:14] == pytest.approx(1.0, abs=0.01)
    assert (filled[:, 40:] == 0.0).all()


def test_a_plume_that_has_left_its_well_is_found_where_it_is_expected() -> None:
    rig = load_rig(small_rig())
    grid = rig.default_grid()
    well = rig.wells['injector']
    whole = drawn(rig, grid, 0.3, 0.0)
    gone, later = (np.where(grid.x < well.x_m + tail, 0.0, whole) for tail in (0.1, 0.12))
    assert plume_lines(gone, rig, grid) == {}
    expected = {'injector': later > 0.5}
    seen = plume_lines(gone, rig, grid, expected)['injector']
    predicted = plume_lines(later, rig, grid, expected)['injector']
    error = line_error(predicted, seen, (well.x_m, well.z_m))
    assert error.tail == pytest.approx(0.02, abs=0.006)
    assert error.tip == pytest.approx(0.0, abs=1e-9)
