"""Tests of grids and maps: cell centres, resampling, errors and unseen cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid, conservative_resample, fill_unseen, relative_error

SIZES = st.integers(1, 23)


def test_cell_centres_lie_half_a_cell_inside_the_rig() -> None:
    grid = Grid(4, 2, 2.0, 1.0)
    np.testing.assert_allclose(grid.x, [0.25, 0.75, 1.25, 1.75])
    np.testing.assert_allclose(grid.z, [0.25, 0.75])
    assert grid.shape == (2, 4)
    assert grid.nx * grid.nz * grid.cell_area == pytest.approx(2.0)


@given(rows=SIZES, columns=SIZES, new_rows=SIZES, new_columns=SIZES, seed=st.integers(0, 99))
def test_resampling_keeps_the_integral_and_the_range(
    rows: int, columns: int, new_rows: int, new_columns: int, seed: int
) -> None:
    field = np.random.default_rng(seed).random((rows, columns))
    moved = conservative_resample(field, (new_rows, new_columns))
    assert moved.mean() == pytest.approx(field.mean(), rel=1e-13)
    assert moved.min() >= field.min() - 1e-12
    assert moved.max() <= field.max() + 1e-12


def test_coarsening_after_refining_returns_the_field() -> None:
    field = np.random.default_rng(5).random((6, 9))
    np.testing.assert_allclose(
        conservative_resample(conservative_resample(field, (18, 27)), (6, 9)), field
    )


def test_not_a_number_spreads_only_to_the_cells_that_overlap_it() -> None:
    field = np.zeros((4, 4))
    field[0, 0] = np.nan
    unknown = np.isnan(conservative_resample(field, (2, 2)))
    assert unknown.tolist() == [[True, False], [False, False]]


@pytest.mark.parametrize('text', ['187', '187x', 'axb', '10x10x10', ''])
def test_a_grid_that_cannot_be_read_says_how_to_write_it(text: str) -> None:
    with pytest.raises(InputError, match='187x112'):
        Grid.parse(text, 1.0, 1.0)


def test_a_grid_with_more_cells_than_numbers_can_count_is_refused() -> None:
    with pytest.raises(InputError, match='cells in a row: take fewer'):
        Grid.parse(f'1{"0" * 400}x3', 1.0, 0.5)


def test_a_grid_without_cells_is_refused() -> None:
    with pytest.raises(InputError, match='at least one cell'):
        Grid.parse('0x5', 1.0, 1.0)


def test_unseen_cells_do_not_count_in_the_relative_error() -> None:
    observed = np.array([[1.0, np.nan]])
    assert relative_error(np.array([[0.9, 55.0]]), observed) == pytest.approx(0.1)
    assert np.isnan(relative_error(np.ones((1, 2)), np.zeros((1, 2))))


def test_unseen_cells_are_taken_from_the_prediction() -> None:
    observed = np.array([[0.2, np.nan], [1.3, 0.0]])
    prediction = np.array([[0.9, 0.7], [0.9, 0.9]])
    assert fill_unseen(observed, prediction).tolist() == [[0.2, 0.7], [1.0, 0.0]]
    assert fill_unseen(observed, None).tolist() == [[0.2, 0.0], [1.0, 0.0]]
