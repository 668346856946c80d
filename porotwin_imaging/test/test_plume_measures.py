"""Measures of maps whose measures are known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.measures.plume_measures import (
    LEAST_INSIDE,
    contour_length,
    finger_count,
    plume_alone,
    plume_measures,
)

GRID = Grid(200, 120, 1.0, 0.6)
PORES = np.full(GRID.shape, GRID.cell_area * 0.01 * 0.4)
X, Z = np.meshgrid(GRID.x, GRID.z)


def blob(x: float, z: float, radius: float = 0.1, rim: float = 0.01) -> np.ndarray:
    return 0.5 * (1 - np.tanh((np.hypot(X - x, Z - z) - radius) / rim))


def test_a_disc_has_its_area_outline_centre_and_spread() -> None:
    found = plume_measures(blob(0.4, 0.3, rim=0.003), GRID, PORES, level=0.5)
    assert found.area_m2 == pytest.approx(np.pi * 0.1**2, rel=0.01)
    # the rim is sharper than the cells: a smooth one has its length to 0.2 %
    assert found.contour_m == pytest.approx(2 * np.pi * 0.1, rel=0.02)
    assert contour_length(blob(0.4, 0.3), GRID, 0.5) == pytest.approx(2 * np.pi * 0.1, rel=2e-3)
    assert (found.x_m, found.z_m) == pytest.approx((0.4, 0.3), abs=1e-4)
    assert (found.spread_x_m, found.spread_z_m) == pytest.approx((0.05, 0.05), rel=0.02)
    assert found.spread_xz == pytest.approx(0.0, abs=1e-3)
    assert found.tracer_ml == pytest.approx(np.pi * 0.1**2 * 0.01 * 0.4 * 1e6, rel=0.01)
    assert found.fingers == 1
    assert np.isnan(found.tracer_deviation_ml)


def test_an_empty_map_has_no_plume() -> None:
    found = plume_measures(np.zeros(GRID.shape), GRID, PORES)
    assert (found.tracer_ml, found.area_m2, found.contour_m, found.fingers) == (0, 0, 0, 0)
    assert np.isnan([found.x_m, found.spread_x_m]).all()


@pytest.mark.parametrize('told', [False, True])
def test_the_noise_of_clean_sand_does_not_move_a_small_plume(told: bool) -> None:
    small = blob(0.9, 0.1, radius=0.03, rim=0.005)
    noise = 0.004 * np.abs(np.random.default_rng(8).standard_normal(GRID.shape))
    deviation = np.full(GRID.shape, 0.004) if told else None
    exact = plume_measures(small, GRID, PORES)
    found = plume_measures(small + noise, GRID, PORES, deviation=deviation)
    assert (found.x_m, found.z_m) == pytest.approx((exact.x_m, exact.z_m), abs=1e-3)
    assert found.spread_x_m == pytest.approx(exact.spread_x_m, rel=0.1)
    assert found.tracer_ml == pytest.approx(exact.tracer_ml, rel=0.05)
    clean = plume_alone(small + noise, GRID, deviation)
    assert clean[:, : GRID.nx // 2].max() == 0.0


def speckled(seed: int) -> np.ndarray:
    """Return denoised camera noise: pale spots of some cells, cut off at 0."""
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal(GRID.shape), 1.0)
    return np.clip(0.012 * noise / noise.std() - 0.006, 0.0, None)


@pytest.mark.parametrize('told', [0.0013, None])
def test_clean_sand_shows_no_plume(told: float | None) -> None:
    noise = speckled(3)
    assert (noise > LEAST_INSIDE).sum() > 100
    deviation = None if told is None else np.full(GRID.shape, told)
    found = plume_measures(noise, GRID, PORES, deviation=deviation)
    assert found.tracer_ml == 0.0
    assert np.isnan([found.x_m, found.z_m, found.spread_x_m, found.x_deviation_m]).all()
    if told is not None:
        assert found.tracer_deviation_ml > 0.0


def test_spots_far_from_a_plume_neither_widen_nor_move_it() -> None:
    small = blob(0.9, 0.1, radius=0.03, rim=0.005)
    deviation = np.full(GRID.shape, 0.0013)
    exact = plume_measures(small, GRID, PORES)
    found = plume_measures(small + speckled(4), GRID, PORES, deviation=deviation)
    assert found.spread_x_m == pytest.approx(exact.spread_x_m, rel=0.05)
    for name in ('x', 'z', 'spread_x', 'spread_z'):
        error = getattr(found, f'{name}_m') - getattr(exact, f'{name}_m')
        assert abs(error) < 4.0 * getattr(found, f'{name}_deviation_m')


def test_correlated_noise_averages_out_more_slowly() -> None:
    deviation = np.full(GRID.shape, 0.005)
    noise = 0.005 * np.random.default_rng(5).standard_normal(GRID.shape)
    smooth = gaussian_filter(noise, 2.0)
    smooth *= 0.005 / smooth.std()
    single, common = (
        plume_measures(blob(0.4, 0.3, rim=0.003) + one, GRID, PORES, deviation=deviation)
        for one in (noise, smooth)
    )
    assert common.x_deviation_m > 3.0 * single.x_deviation_m


@pytest.mark.parametrize('peak', [0.03, 0.06])
def test_a_pale_plume_of_a_clean_map_is_a_plume(peak: float) -> None:
    found = plume_measures(peak * blob(0.4, 0.3), GRID, PORES, deviation=np.zeros(GRID.shape))
    assert found.x_m == pytest.approx(0.4, abs=1e-3)
    assert found.x_deviation_m < 1e-3


@pytest.mark.parametrize('strength', [1.0, 0.1, 0.019, 0.001])
def test_a_plume_of_a_model_has_its_mass_however_pale(strength: float) -> None:
    full = blob(0.4, 0.3)
    found = plume_measures(strength * full, GRID, PORES)
    assert found.tracer_ml == pytest.approx(strength * (full * PORES).sum() * 1e6, rel=0.01)


def test_a_pale_spot_of_a_photograph_is_noise() -> None:
    spot = 0.01 * blob(0.4, 0.3, radius=0.02, rim=0.003)
    deviation = np.full(GRID.shape, 0.003)
    assert plume_measures(spot, GRID, PORES, deviation=deviation).tracer_ml == 0.0


def test_noise_of_packed_values_is_no_plume() -> None:
    noise = 0.003 * np.abs(np.random.default_rng(8).standard_normal(GRID.shape))
    packed = 0.004 * np.round(noise / 0.004)
    assert plume_measures(packed, GRID, PORES).tracer_ml == 0.0


def test_a_leaning_plume_has_a_correlation() -> None:
    leaning = np.exp(-(((X - 0.5) - (Z - 0.3)) ** 2) / 0.002 - ((X - 0.5) ** 2) / 0.02)
    assert plume_measures(leaning, GRID, PORES).spread_xz > 0.5


def test_the_outline_ends_where_nothing_is_seen() -> None:
    values = blob(0.4, 0.3)
    whole = contour_length(values, GRID)
    values[:, : GRID.nx * 4 // 10] = np.nan
    assert contour_length(values, GRID) == pytest.approx(whole / 2, rel=0.05)


@pytest.mark.parametrize(('side', 'turned'), [('down', 0), ('right', 1), ('up', 2), ('left', 3)])
@pytest.mark.parametrize('count', [1, 2, 5])
def test_fingers_are_counted_on_their_side(side, turned, count) -> None:
    square = Grid(120, 120, 0.6, 0.6)
    x, z = np.meshgrid(square.x, square.z)
    reach = 0.1 + 0.15 * np.abs(np.sin(np.pi * count * x / 0.6))
    values = np.where((z < 0.5) & (z > 0.5 - reach), 1.0, 0.0)
    assert finger_count(np.rot90(values, -turned), square, side=side) == count


def test_noise_is_no_finger() -> None:
    surface = 0.3 + 0.004 * np.random.default_rng(5).random(GRID.nx)
    values = np.where(surface < Z, 1.0, 0.0)
    assert finger_count(values, GRID) == 1


def test_the_random_part_averages_out_and_the_systematic_part_does_not() -> None:
    values = blob(0.4, 0.3)
    part = 0.05 * values
    random = plume_measures(values, GRID, PORES, deviation=part)
    common = plume_measures(values, GRID, PORES, deviation=part, systematic=part)
    assert common.tracer_deviation_ml == pytest.approx(0.05 * common.tracer_ml, rel=1e-4)
    assert random.tracer_deviation_ml < 0.1 * common.tracer_deviation_ml
    # a wrong scale does not move the centre
    assert common.x_deviation_m < 1e-6 < random.x_deviation_m < 1e-3
    assert common.area_deviation_m2 > 0.0


def test_a_wrong_level_or_side_is_named() -> None:
    with pytest.raises(InputError, match='level 2'):
        plume_measures(blob(0.4, 0.3), GRID, PORES, level=2.0)
    with pytest.raises(InputError, match='down, up, left, right'):
        plume_measures(blob(0.4, 0.3), GRID, PORES, side='below')  # type: ignore[arg-type]


def test_a_map_without_any_value_has_no_measures() -> None:
    for nothing in (np.nan, np.inf):
        found = plume_measures(np.full(GRID.shape, nothing), GRID, PORES)
        assert found.seen == 0.0
        assert np.isnan([found.tracer_ml, found.area_m2, found.contour_m, found.fingers]).all()


def test_noise_around_zero_has_no_centre() -> None:
    noise = np.random.default_rng(2).normal(0.0, 0.01, GRID.shape)
    found = plume_measures(noise, GRID, PORES, deviation=np.full(GRID.shape, 0.02))
    assert np.isnan([found.x_m, found.z_m, found.spread_x_m, found.spread_xz]).all()


@pytest.mark.parametrize('unknown', [np.nan, -0.1])
def test_unknown_deviations_are_not_zero(unknown: float) -> None:
    values = blob(0.4, 0.3)
    deviation = 0.05 * values
    deviation[60, 80] = unknown
    found = plume_measures(values, GRID, PORES, deviation=deviation)
    assert np.isnan([found.tracer_deviation_ml, found.x_deviation_m, found.area_deviation_m2]).all()
    values[60, 80] = np.nan
    assert plume_measures(values, GRID, PORES, deviation=deviation).tracer_deviation_ml > 0.0
