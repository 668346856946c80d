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
