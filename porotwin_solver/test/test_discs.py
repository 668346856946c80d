"""The distribution of a well's disc over the cells of a grid."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_solver.coefficients.discs import disc_fractions

GRID = Grid(37, 23, 0.934, 0.562)


@given(x=st.floats(0.01, 0.92), z=st.floats(0.01, 0.55), radius=st.floats(0.001, 0.009))
def test_fractions_add_up_to_one_and_centre_on_the_well(x: float, z: float, radius: float) -> None:
    cells, fractions = disc_fractions(Grid(400, 300, 0.934, 0.562), x, z, radius)
    assert fractions.sum() == pytest.approx(1.0, abs=1e-12)
    assert (fractions > 0).all()
    grid = Grid(400, 300, 0.934, 0.562)
    centre_x = (fractions * grid.x[cells % grid.nx]).sum()
    # the centroid of a cell's overlap lies within half a cell of its centre
    assert abs(centre_x - x) < 0.5 * grid.dx


def test_a_disc_on_a_corner_overlaps_four_cells_equally() -> None:
    cells, fractions = disc_fractions(GRID, 10 * GRID.dx, 5 * GRID.dz, 0.004)
    assert sorted(cells) == [4 * 37 + 9, 4 * 37 + 10, 5 * 37 + 9, 5 * 37 + 10]
    np.testing.assert_allclose(fractions, 0.25, rtol=1e-12)


def test_the_overlap_is_the_area_of_the_circular_segment() -> None:
    radius, cut = 0.016, 0.006
    cells, fractions = disc_fractions(GRID, 10 * GRID.dx - cut, 5.5 * GRID.dz, radius)
    beyond = radius**2 * math.acos(cut / radius) - cut * math.sqrt(radius**2 - cut**2)
    right = fractions[cells % 37 == 10].sum()
    assert right == pytest.approx(beyond / (math.pi * radius**2), rel=1e-12)


@given(shift=st.floats(0.0, 0.5))
def test_a_small_disc_that_moves_within_a_cell_moves_its_water(shift: float) -> None:
    cells, fractions = disc_fractions(GRID, (10.5 + shift) * GRID.dx, 5.5 * GRID.dz, 0.001)
    right = fractions[cells % 37 == 11].sum()
    # the segment of a disc as wide as a cell, beyond the distance 1/2 - shift from its centre
    half = 0.5 * max(GRID.dx, GRID.dz)
    cut = min((0.5 - shift) * GRID.dx, half)
    beyond = half**2 * math.acos(cut / half) - cut * math.sqrt(half**2 - cut**2)
    assert right == pytest.approx(beyond / (math.pi * half**2), abs=1e-9)


def test_the_fractions_of_a_disc_over_the_edge_add_up_to_one() -> None:
    _, fractions = disc_fractions(GRID, 0.001, 0.3, 0.004)
    assert fractions.sum() == pytest.approx(1.0, abs=1e-14)


def test_a_well_outside_the_rig_is_refused() -> None:
    with pytest.raises(InputError, match=r'well at \(1\.2, 0\.3\) m lies outside the rig'):
        disc_fractions(GRID, 1.2, 0.3, 0.004)
