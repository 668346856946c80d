"""Photographs in another light are corrected, left out in part, or refused; none erases a plume."""

import dataclasses
import re

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.photo_to_map import concentration_map


@pytest.fixture(scope='module')
def truth(make_plume, true_shape) -> np.ndarray:
    return make_plume(true_shape, 0.4, 0.25, 0.12)


@pytest.fixture(scope='module')
def without_chart(laboratory, calibration, empty_photograph) -> Baseline:
    rig = laboratory.rig
    camera = rig.camera.model_copy(update={'colour_checker_px': None})
    rig = rig.model_copy(update={'camera': camera})
    return make_baseline(rig, rig.grid(90, 50), [empty_photograph], calibration=calibration)


@pytest.mark.parametrize('gain', [0.25, 1.5, 2.0])
def test_the_chart_corrects_another_exposure(
    baseline, laboratory, truth, relative_error, gain: float
) -> None:
    found = concentration_map(laboratory.photograph(truth, gain=gain), baseline)
    assert np.isfinite(found.values).mean() > 0.97
    assert relative_error(found.values, truth) < 0.06
    (line,) = found.status
    assert line == f'{gain:.2g} times the light of the baseline: corrected by the colour chart'


@pytest.mark.parametrize('gain', [0.5, 1.5])
def test_without_a_chart_most_of_the_sand_corrects_another_exposure(
    without_chart, laboratory, truth, relative_error, gain: float
) -> None:
    found = concentration_map(laboratory.photograph(truth, gain=gain), without_chart)
    assert relative_error(found.values, truth) < 0.08
    assert found.suspicious
    assert any(line.startswith(f'{gain:.2g} times') for line in found.status)


def test_without_a_chart_an_exposure_far_off_is_refused(without_chart, laboratory, truth) -> None:
    with pytest.raises(InputError, match=r'times the light of its baseline|over-exposed|brighter'):
        concentration_map(laboratory.photograph(truth, gain=6.0), without_chart)


def test_a_rig_full_of_tracer_is_not_taken_for_another_exposure(
    without_chart, laboratory, no_tracer
) -> None:
    """All sand is darker alike, but the frame beside it is not."""
    with pytest.raises(InputError, match='times the light of its baseline'):
        concentration_map(laboratory.photograph(np.ones_like(no_tracer)), without_chart)


def test_sloping_light_and_another_white_balance_are_told(
    without_chart, laboratory, truth, make_jpeg, relative_error
) -> None:
    light = laboratory.scene(truth)
    slope = np.linspace(1.0, 0.6, light.shape[1])[None, :, None]
    for change, told in (
        (slope, r'0\.6\d? times the light of another part'),
        (np.array([0.85, 1.0, 1.25]), 'white balance'),
    ):
        found = concentration_map(make_jpeg(light * change), without_chart)
        (line,) = found.status
        assert re.search(told, line)
        assert relative_error(found.values, truth) < 0.08


@pytest.mark.parametrize('veil', [0.01, 0.03])
def test_the_chart_shows_haze_over_even_sand(
    baseline, laboratory, truth, make_jpeg, relative_error, veil: float
) -> None:
    found = concentration_map(make_jpeg(laboratory.scene(truth) + veil), baseline)
    (line,) = found.status
    assert 'haze or stray light' in line
    assert relative_error(found.values, truth) < 0.06


def test_a_reflection_on_the_chart_alone_is_no_haze(
    baseline, laboratory, truth, make_jpeg, relative_error
) -> None:
    light = laboratory.scene(truth)
    corners = np.array(laboratory.rig.camera.colour_checker_px)
    (left, top), (right, low) = corners.min(axis=0).astype(int), corners.max(axis=0).astype(int)
    light[top - 9 : low + 9, left - 9 : right + 9] += 0.1
    found = concentration_map(make_jpeg(light), baseline)
    assert found.status == []
    assert relative_error(found.values, truth) < 0.06


@pytest.mark.parametrize('factor', [1.5, 3.0])
def test_brighter_pixels_are_refused(baseline, photograph_of_plume, factor: float) -> None:
    pixels = cv2.imdecode(np.frombuffer(photograph_of_plume, np.uint8), cv2.IMREAD_COLOR)
    data = cv2.imencode('.jpg', cv2.convertScaleAbs(pixels, alpha=factor))[1].tobytes()
    with pytest.raises(InputError, match=r'over-exposed|times the light of its baseline'):
        concentration_map(data, baseline)


def test_a_flash_is_refused_and_a_small_reflection_left_out(
    baseline, laboratory, truth, make_jpeg, relative_error
) -> None:
    light = laboratory.scene(truth)
    rows, columns = np.mgrid[: light.shape[0], : light.shape[1]]
    distance = np.hypot(columns - 620, rows - 300)
    flash = light * (1.0 + 1.0 * np.exp(-((distance / 150) ** 2)))[..., None]
    with pytest.raises(InputError, match=r'is brighter than its baseline.* of the sand'):
        concentration_map(make_jpeg(flash), baseline)
    reflection = light * (1.0 + 0.6 * np.exp(-((distance / 30) ** 2)))[..., None]
    found = concentration_map(make_jpeg(reflection), baseline)
    assert any('is near a reflection or lamp: left out' in line for line in found.status)
    assert found.suspicious
    assert 0.85 < np.isfinite(found.values).mean() < 0.99
    assert relative_error(found.values, truth) < 0.05


def test_beside_a_soft_reflection_maps_are_less_certain(
    baseline, laboratory, truth, make_jpeg
) -> None:
    light = laboratory.scene(truth)
    rows, columns = np.mgrid[: light.shape[0], : light.shape[1]]
    distance = np.hypot(columns - 620, rows - 300)
    soft = light + 0.1 * np.exp(-((distance / 60) ** 2))[..., None]
    found, plain = (concentration_map(make_jpeg(one), baseline) for one in (soft, light))
    hidden = np.isnan(found.values)
    beside = cv2.dilate(hidden.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    beside &= ~hidden
    assert hidden.any()
    assert np.median(found.deviation[beside]) > 2.0 * np.median(plain.deviation[beside])


def test_a_clipped_part_is_left_out_with_its_share(
    baseline, laboratory, truth, make_jpeg, relative_error
) -> None:
    light = laboratory.scene(truth)
    light[150:600, 650:730, 2] = 1.0  # one channel only
    found = concentration_map(make_jpeg(light), baseline)
    assert any('% of the sand is over-exposed: left out' in line for line in found.status)
    assert np.isnan(found.values[:, 69:75]).all()
    assert relative_error(found.values, truth) < 0.05


def test_a_grey_photograph_is_refused(baseline, photograph_of_plume) -> None:
    with pytest.raises(InputError, match='photograph is grey, its baseline coloured'):
        concentration_map(_as_grey(photograph_of_plume), baseline)


def test_a_baseline_says_that_it_is_over_exposed(laboratory, no_tracer, make_jpeg) -> None:
    rig = laboratory.rig
    light = laboratory.scene(no_tracer)
    light[300:360, 300:400] = 1.0
    remarks = make_baseline(rig, rig.grid(90, 50), [make_jpeg(light)]).remarks
    assert any('% of the rig is over-exposed: tracer is not seen there' in line for line in remarks)
    light[150:600, 300:700] = 1.0
    with pytest.raises(InputError, match=r'baseline is over-exposed on .* of the rig'):
        make_baseline(rig, rig.grid(90, 50), [make_jpeg(light)])


def test_grey_photographs_need_a_calibration_of_grey_ones(
    laboratory, calibration, empty_photograph, make_jpeg, no_tracer
) -> None:
    rig = laboratory.rig
    grid = rig.grid(90, 50)
    grey = _as_grey(empty_photograph)

    def made(photograph: bytes, absorbance: tuple[float, float, float] | None) -> Baseline:
        signal = dataclasses.replace(calibration.signal, absorbance=absorbance)
        used = dataclasses.replace(calibration, signal=signal)
        return make_baseline(rig, grid, [photograph], calibration=used)

    with pytest.raises(InputError, match='photographs are grey, but the calibration is of colour'):
        made(grey, (1.2, 0.45, 0.8))
    for unknown_or_grey in (None, (0.8, 0.8, 0.79)):
        made(grey, unknown_or_grey)
    white = laboratory.scene(no_tracer).mean(axis=2, keepdims=True) * np.ones(3)
    for coloured in (empty_photograph, make_jpeg(white)):  # noise colours white sand
        made(coloured, (1.2, 0.45, 0.8))


def _as_grey(photograph: bytes) -> bytes:
    pixels = cv2.imdecode(np.frombuffer(photograph, np.uint8), cv2.IMREAD_GRAYSCALE)
    return cv2.imencode('.jpg', pixels)[1].tobytes()
