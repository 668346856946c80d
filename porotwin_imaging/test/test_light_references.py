"""Places that never change tell the light and the place of photographs, prints and scans."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.calibrating.relative_scale import relative_calibration
from porotwin_imaging.photo_to_map import concentration_map

LEFT = ((2, 150), (30, 150), (30, 600), (2, 600))
"""A part of the frame of the laboratory, beside the sand."""


@pytest.fixture(scope='module')
def rig(laboratory) -> Rig:
    camera = laboratory.rig.camera.model_copy(
        update={'colour_checker_px': None, 'references_px': (LEFT,)}
    )
    return laboratory.rig.model_copy(update={'camera': camera})


@pytest.fixture(scope='module')
def referenced(rig, calibration, empty_photograph) -> Baseline:
    return make_baseline(rig, rig.grid(90, 50), [empty_photograph], calibration=calibration)


def reprinted(jpeg: bytes, matrix: np.ndarray, size: tuple[int, int], *, grey: bool) -> bytes:
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if grey:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    moved = cv2.warpAffine(pixels, matrix, size, flags=cv2.INTER_AREA)
    return cv2.imencode('.png', moved)[1].tobytes()


@pytest.mark.parametrize('gain', [0.4, 1.6])
def test_a_frame_corrects_another_exposure(
    referenced, laboratory, true_map, relative_error, gain: float
) -> None:
    found = concentration_map(laboratory.photograph(true_map, gain=gain), referenced)
    assert relative_error(found.values, true_map) < 0.06
    assert not found.suspicious
    assert found.status[0].startswith(f'{gain:.2g} times the light')


def test_a_frame_tells_light_where_tracer_fills_the_rig(referenced, laboratory, no_tracer) -> None:
    found = concentration_map(laboratory.photograph(np.ones_like(no_tracer)), referenced)
    assert np.nanmedian(found.values) == pytest.approx(1.0, abs=0.05)


def test_a_print_of_another_crop_and_scale_is_registered(
    referenced, laboratory, true_map, relative_error
) -> None:
    turn = np.deg2rad(2.0)
    scale = 0.85 * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    matrix = np.column_stack([scale, [120.0, 60.0]])
    data = reprinted(laboratory.photograph(true_map, gain=0.7), matrix, (940, 700), grey=False)
    found = concentration_map(data, referenced)
    assert found.alignment.print_or_scan
    assert found.alignment.residual < 1.0
    assert found.alignment.homography[:2] == pytest.approx(matrix, abs=0.8)
    assert relative_error(found.values, true_map) < 0.1


def test_a_print_of_another_scene_is_refused(referenced) -> None:
    noise = np.random.default_rng(0).integers(40, 200, (500, 700, 3)).astype(np.uint8)
    data = cv2.imencode('.png', noise)[1].tobytes()
    with pytest.raises(InputError, match='features of the scene agree'):
        concentration_map(data, referenced)


def test_without_references_another_size_is_refused(baseline, photograph_of_plume) -> None:
    data = reprinted(photograph_of_plume, np.eye(2, 3), (700, 640), grey=False)
    with pytest.raises(InputError, match='references_px'):
        concentration_map(data, baseline)


def test_grey_prints_map_on_a_relative_scale(
    rig, laboratory, empty_photograph, true_map, relative_error
) -> None:
    matrix = np.array([[0.9, 0.0, 20.0], [0.0, 0.9, -10.0]])
    before = reprinted(empty_photograph, np.eye(2, 3), laboratory.size, grey=True)
    after = reprinted(laboratory.photograph(true_map, gain=0.8), matrix, (800, 560), grey=True)
    baseline = make_baseline(rig, rig.grid(90, 50), [before])
    scale = relative_calibration(baseline, [lambda: after])
    assert scale.is_relative
    baseline = make_baseline(rig, rig.grid(90, 50), [before], calibration=scale)
    assert relative_error(concentration_map(after, baseline).values, true_map) < 0.1


def test_without_tracer_there_is_no_relative_scale(referenced) -> None:
    with pytest.raises(InputError, match='no photograph is darker'):
        relative_calibration(referenced, [])
