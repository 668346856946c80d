"""From photograph to map, on photographs of the small laboratory."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import conservative_resample
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map


@pytest.mark.parametrize(
    'conditions',
    [{}, {'gain': 1.1, 'slope': 0.05}, {'gain': 0.9, 'shift': (15.0, -9.0)}, {'shift': (3.4, 2.2)}],
    ids=['same', 'brighter', 'darker and nudged', 'half a pixel'],
)
def test_light_and_camera_do_not_change_the_map(
    baseline, laboratory, true_map, relative_error, conditions
) -> None:
    found = concentration_map(laboratory.photograph(true_map, **conditions), baseline)
    assert relative_error(found.values, true_map) < 0.03
    assert np.nanmean(found.values) == pytest.approx(true_map.mean(), rel=0.02)
    shift = np.hypot(*conditions.get('shift', (0, 0)))
    assert any('camera has moved' in line for line in found.status) == (shift > 2)


def test_row_zero_is_the_bottom(baseline, laboratory, make_plume, true_shape) -> None:
    data = laboratory.photograph(make_plume(true_shape, 0.2, 0.1, 0.06))
    values = concentration_map(data, baseline).values
    assert values[:20].sum() > 10 * values[30:].sum()
    assert values[:, :40].sum() > 10 * values[:, 50:].sum()


def test_the_stated_noise_covers_the_error_of_the_map(baseline, laboratory, true_map) -> None:
    found = concentration_map(laboratory.photograph(true_map, noise=3.0, seed=4), baseline)
    truth = conservative_resample(true_map, found.values.shape)
    within = np.abs(found.values - truth) < 2 * found.deviation
    assert within.mean() > 0.85
    assert 1e-4 < found.typical_noise < 0.02


def test_the_same_photograph_gives_the_same_map(
    baseline, laboratory, make_plume, true_shape
) -> None:
    data = laboratory.photograph(make_plume(true_shape, 0.5, 0.2, 0.1))
    first, second = concentration_map(data, baseline), concentration_map(data, baseline)
    np.testing.assert_array_equal(first.values, second.values)


def test_without_a_calibration_the_status_says_so(laboratory, no_tracer, empty_photograph) -> None:
    rig = laboratory.rig
    baseline = make_baseline(rig, rig.grid(90, 50), [empty_photograph])
    found = concentration_map(laboratory.photograph(no_tracer, seed=2), baseline)
    assert not found.calibrated
    assert found.status == ['uncalibrated: default scaling']


@pytest.mark.parametrize('grid', [(30, 17), (90, 50), (890, 480)])
def test_the_mass_does_not_depend_on_the_grid(
    laboratory, calibration, empty_photograph, photograph_of_plume, true_map, grid
) -> None:
    rig = laboratory.rig
    baseline = make_baseline(rig, rig.grid(*grid), [empty_photograph], calibration=calibration)
    found = concentration_map(photograph_of_plume, baseline)
    assert found.values.shape == (grid[1], grid[0])
    assert np.nanmean(found.values) == pytest.approx(true_map.mean(), rel=0.03)


def test_unusable_photographs_are_refused_and_do_not_affect_the_next(
    baseline,
    laboratory,
    new_laboratory,
    no_tracer,
    true_map,
    photograph_of_plume,
    relative_error,
) -> None:
    good = photograph_of_plume
    other = new_laboratory(seed=77).photograph(no_tracer)
    larger = cv2.imencode('.jpg', np.full((700, 890, 3), 90, np.uint8))[1].tobytes()
    for data, complaint in (
        (good[: len(good) // 2], 'truncated'),
        (laboratory.photograph(no_tracer, gain=0.0005, noise=0.0), 'black'),
        (laboratory.photograph(no_tracer, gain=60.0), 'over-exposed'),
        (larger, 'px, the baseline'),
        (other, 'does not match the baseline'),
    ):
        with pytest.raises(InputError, match=complaint):
            concentration_map(data, baseline)
    assert relative_error(concentration_map(good, baseline).values, true_map) < 0.03
