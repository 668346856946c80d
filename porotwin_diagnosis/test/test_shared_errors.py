"""Errors that all maps share: their sizes, their modes, and residuals without them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import rig_from_maps
from porotwin_diagnosis.data.shared_errors import (
    ErrorSizes,
    SharedErrors,
    derivatives,
    error_modes,
    measured_errors,
    sands_of,
)

GRID = Grid(60, 40, 0.6, 0.4)
ONE_SAND = np.zeros(GRID.shape, dtype=int)
SIZES = ErrorSizes((0.03,), bend=0.04, place_m=4e-4, blur_m2=5e-6)


def plumes(count=6):
    """Return maps (nt, nz, nx) of a growing plume with soft edges."""
    x, z = np.meshgrid(GRID.x - 0.3, GRID.z - 0.2)
    radii = np.linspace(0.05, 0.15, count)[:, None, None]
    return 0.5 * (1 - np.tanh((np.hypot(x, z) - radii) / 0.015))


def delivered(maps, sizes, sands=ONE_SAND):
    """Return the systematic deviation that an imaging with these errors delivers.

    Squares of slopes and bends are means over a cell and its neighbours, as imaging delivers them.
    """
    slope_z, slope_x, bend = derivatives(maps, GRID)
    at_fronts = (sizes.place_m * np.hypot(slope_z, slope_x), 0.5 * sizes.blur_m2 * bend)
    squares = (
        (np.array(sizes.scales)[sands] * maps) ** 2,
        (4 * sizes.bend * maps * (1 - maps)) ** 2,
        *(uniform_filter(part**2, (1, 3, 3)) for part in at_fronts),
    )
    return np.sqrt(np.maximum(sum(squares), 0.0))


def test_the_bend_of_a_sharp_front_is_that_of_the_next_cells():
    step = np.zeros((1, *GRID.shape))
    step[:, :, 30:] = 1.0
    _, _, bend = derivatives(step, GRID)
    assert bend[0, 20, 28:32] * GRID.dx**2 == pytest.approx([0.0, 1.0, -1.0, 0.0])


def test_the_sizes_of_all_errors_are_read_from_the_deviations():
    maps = plumes()
    found = measured_errors(maps, delivered(maps, SIZES), ONE_SAND, GRID)
    assert found.scales == pytest.approx(SIZES.scales, rel=0.02)
    assert (found.bend, found.place_m, found.blur_m2) == pytest.approx(
        (SIZES.bend, SIZES.place_m, SIZES.blur_m2), rel=0.05
    )


def test_each_sand_has_its_own_scale():
    sands = np.where(GRID.x > 0.3, 1, 0) * np.ones((GRID.nz, 1), dtype=int)
    sizes = replace(SIZES, scales=(0.02, 0.15))
    maps = plumes()
    found = measured_errors(maps, delivered(maps, sizes, sands), sands, GRID)
    assert found.scales == pytest.approx(sizes.scales, rel=0.05)


def test_unseen_cells_and_maps_without_tracer_tell_nothing():
    maps = plumes()
    holes = maps.copy()
    holes[:, :, 20:25] = np.nan
    found = measured_errors(holes, delivered(maps, SIZES), ONE_SAND, GRID)
    assert found.bend == pytest.approx(SIZES.bend, rel=0.1)
    nothing = measured_errors(np.zeros_like(maps), np.zeros_like(maps), ONE_SAND, GRID)
    assert nothing == ErrorSizes((0.0,), 0.0, 0.0, 0.0)


@pytest.mark.parametrize('error', ['scale', 'bend', 'shift', 'stretch'])
def test_a_shared_error_of_one_deviation_costs_one(error):
    """The remaining sum of squares equals one standard deviation of one number.

    A stretch moves all four corners.
    """
    maps = plumes()
    slope_z, slope_x, _ = derivatives(maps, GRID)
    wrong = {
        'scale': 0.03 * maps,
        'bend': 0.16 * maps * (1 - maps),
        'shift': 4e-4 * slope_x,
        'stretch': 4e-4 * slope_z * (2 * GRID.z / GRID.height - 1)[:, None],
    }[error]
    shared = SharedErrors(100 * error_modes(SIZES, maps, ONE_SAND, GRID), cost=5.0)
    left = float(np.sum(shared.decorrelated(100 * wrong) ** 2))
    assert left < (3.5 if error == 'stretch' else 2.0) * shared.cost
    assert left < 0.1 * float(np.sum((100 * wrong) ** 2))


def test_a_core_that_was_taken_for_stock_costs_little_whatever_imaging_states():
    exact = replace(SIZES, scales=(0.0,), bend=0.0)
    maps = plumes()
    shared = SharedErrors(100 * error_modes(exact, maps, ONE_SAND, GRID), cost=5.0)
    left = float(np.sum(shared.decorrelated(100 * 0.05 * maps) ** 2))
    assert left == pytest.approx(shared.cost, rel=0.05)


def test_what_no_error_looks_like_stays():
    generator = np.random.default_rng(6)
    maps = plumes()
    noise = generator.standard_normal(maps.shape)
    shared = SharedErrors(100 * error_modes(SIZES, maps, ONE_SAND, GRID), cost=5.0)
    left = shared.decorrelated(noise)
    assert np.sum(left**2) == pytest.approx(np.sum(noise**2), rel=0.01)


def test_decorrelated_residuals_have_the_covariance_of_independent_ones():
    generator = np.random.default_rng(8)
    modes, cost = generator.standard_normal((3, 40)), 2.0
    shared = SharedErrors(modes, cost)
    root = np.stack([shared.decorrelated(one) for one in np.eye(40)])
    covariance = np.eye(40) + modes.T @ modes / cost
    np.testing.assert_allclose(root @ covariance @ root.T, np.eye(40), atol=1e-9)


def test_errors_that_the_residuals_hardly_show_cost_less():
    modes = np.diag([100.0, 0.01]) @ np.eye(2, 30)
    assert SharedErrors(modes, cost=1.0).effective_number == pytest.approx(1.0, abs=0.01)


def test_equal_modes_count_once():
    modes = np.ones((2, 10))
    twice = SharedErrors(modes, cost=1.0).decorrelated(np.ones(10))
    once = SharedErrors(np.sqrt(2) * modes[:1], cost=1.0).decorrelated(np.ones(10))
    np.testing.assert_allclose(twice, once)


def rig_with(permeability):
    """Return a rig of the size of the grid with this permeability (nz, nx) [m^2]."""
    data = {
        'name': 'sands',
        'width_m': GRID.width,
        'height_m': GRID.height,
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'wells': {'injector': {'x_m': 0.3, 'z_m': 0.2}},
    }
    return rig_from_maps(data, {'depth_m': 0.01, 'porosity': 0.4, 'permeability_m2': permeability})


def test_sands_follow_from_the_permeability():
    two = np.full(GRID.shape, 1e-9)
    two[20:] = 4e-9
    sands = sands_of(rig_with(two), GRID)
    assert (sands[:20] == 0).all()
    assert (sands[20:] == 1).all()
    rough = two * np.exp(0.5 * np.random.default_rng(3).standard_normal(GRID.shape))
    assert (sands_of(rig_with(rough), GRID) == 0).all()
