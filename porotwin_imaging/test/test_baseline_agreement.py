"""Several baselines: light, shake and noise may differ, the sand may not."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.baseline.baseline_agreement import refuse_other_sand
from porotwin_imaging.photo_to_map import concentration_map

COARSE, MIDDLE, FINE = (45, 25), (90, 50), (240, 134)
"""Sizes of grids, columns and rows."""
NAMES = ['photos/first.jpg', 'photos/second.jpg', 'photos/third.jpg']


def _made(laboratory, calibration, *photographs: bytes, size=MIDDLE) -> Baseline:
    rig, names = laboratory.rig, NAMES[: len(photographs)]
    grid = rig.grid(*size)
    return make_baseline(rig, grid, photographs, calibration=calibration, names=names)


def _with_hand(photograph: bytes) -> bytes:
    pixels = cv2.imdecode(np.frombuffer(photograph, np.uint8), cv2.IMREAD_COLOR)
    middle = (pixels.shape[1] // 2, pixels.shape[0] // 2)
    cv2.ellipse(pixels, middle, (60, 90), 20, 0, 360, (120, 150, 200), -1)
    return cv2.imencode('.jpg', pixels)[1].tobytes()


def test_a_hand_in_a_further_baseline_is_refused(laboratory, calibration, empty_photograph) -> None:
    hand = _with_hand(empty_photograph)
    with pytest.raises(
        InputError, match=r'^photos/second.jpg: differs from photos/first.jpg on .* % of the sand'
    ):
        _made(laboratory, calibration, empty_photograph, hand)
    with pytest.raises(InputError, match=r'^photos/third.jpg: differs from photos/first.jpg'):
        _made(laboratory, calibration, empty_photograph, empty_photograph, hand)
    with pytest.raises(InputError, match=r'^photos/second.jpg: differs from photos/first.jpg'):
        _made(laboratory, calibration, hand, empty_photograph)


@pytest.mark.parametrize(
    ('size', 'radius', 'share'),
    [
        (MIDDLE, 0.04, 1.0),
        (MIDDLE, 0.12, 0.3),
        (MIDDLE, 0.2, 1.0),
        (COARSE, 0.04, 1.0),
        (FINE, 0.12, 0.3),
    ],
)
def test_tracer_in_a_further_baseline_is_refused(
    laboratory, calibration, make_plume, true_shape, empty_photograph, size, radius, share
) -> None:
    tracer = laboratory.photograph(share * make_plume(true_shape, 0.4, 0.25, radius), seed=2)
    with pytest.raises(InputError, match=r'^photos/second.jpg: differs from photos/first.jpg'):
        _made(laboratory, calibration, empty_photograph, tracer, size=size)


ALL_AT_ONCE = {'gain': 0.8, 'slope': -0.2, 'shift': (2.4, 1.7), 'noise': 3.0}


@pytest.mark.parametrize(
    ('size', 'difference'),
    [
        (MIDDLE, {'gain': 0.6}),
        (MIDDLE, {'gain': 1.35}),
        (MIDDLE, {'slope': 0.4}),
        (MIDDLE, {'shift': (6.3, -4.6)}),
        (MIDDLE, {'noise': 4.0}),
        (MIDDLE, ALL_AT_ONCE),
        (COARSE, ALL_AT_ONCE),
        (FINE, ALL_AT_ONCE),
    ],
)
def test_light_shake_and_noise_may_differ(
    laboratory,
    calibration,
    no_tracer,
    true_map,
    photograph_of_plume,
    empty_photograph,
    relative_error,
    size,
    difference,
) -> None:
    other = laboratory.photograph(no_tracer, seed=5, **difference)
    baseline = _made(laboratory, calibration, empty_photograph, other, size=size)
    found = concentration_map(photograph_of_plume, baseline)
    assert relative_error(found.values, true_map) < 0.04


def test_hidden_cells_do_not_count() -> None:
    visible = np.ones((40, 60), bool)
    visible[:, :20] = False
    residual = np.where(visible[..., None], 0.0, -1.0) * np.ones(3)
    refuse_other_sand(residual, visible, 'first')
    with pytest.raises(InputError, match=r'differs from first on 100\.0 % of the sand'):
        refuse_other_sand(residual - 1.0, visible, 'first')
