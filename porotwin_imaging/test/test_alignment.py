"""Alignment of a photograph to its baseline."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.geometry.alignment import (
    Alignment,
    ReferenceFeatures,
    align,
    alignment_remarks,
    reference_features,
)

ROWS, COLUMNS = 500, 800


def sand(seed: int) -> np.ndarray:
    grains = np.random.default_rng(seed).normal(0, 1, (ROWS // 3, COLUMNS // 3))
    mottled = cv2.resize(grains.astype(np.float32), (COLUMNS, ROWS), interpolation=cv2.INTER_CUBIC)
    grey = np.clip(110 + 30 * mottled, 0, 255)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def moved(picture: np.ndarray, homography: np.ndarray) -> np.ndarray:
    return cv2.warpPerspective(
        picture, homography, (COLUMNS, ROWS), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
    )


def worst(found: np.ndarray, true: np.ndarray) -> float:
    corners = np.array([[[50.0, 50]], [[750, 50]], [[750, 450]], [[50, 450]]])
    there = [cv2.perspectiveTransform(corners, matrix) for matrix in (found, true)]
    return float(np.abs(there[0] - there[1]).max())


@pytest.fixture(scope='module')
def features() -> ReferenceFeatures:
    return reference_features(sand(1), np.ones((ROWS, COLUMNS), bool))


@pytest.mark.parametrize(
    'homography',
    [
        np.eye(3),
        np.array([[1, 0, 12.3], [0, 1, -8.6], [0, 0, 1]]),
        np.array([[1.002, 0.004, 3], [-0.004, 0.999, 2], [2e-6, -1e-6, 1]]),
        np.array([[1, 0, 140.0], [0, 1, 60.0], [0, 0, 1]]),
    ],
    ids=['same place', 'nudged', 'rotated', 'far'],
)
def test_a_moved_camera_is_found_to_a_tenth_of_a_pixel(features, homography) -> None:
    found = align(moved(sand(1), homography), features)
    assert worst(found.homography, homography) < 0.1
    assert found.residual < 0.2


def test_tracer_and_light_do_not_move_the_alignment(features) -> None:
    shift = np.array([[1, 0, 5.0], [0, 1, 3.0], [0, 0, 1]])
    picture = moved(sand(1), shift).astype(float) * np.linspace(0.8, 1.1, COLUMNS)[None, :, None]
    row, column = np.ogrid[:ROWS, :COLUMNS]
    plume = np.clip((180 - np.hypot(row - 250, column - 400)) / 30, 0, 1)
    picture *= 1 - 0.7 * plume[..., None]
    assert worst(align(picture.astype(np.uint8), features).homography, shift) < 0.15


@pytest.mark.parametrize(
    ('turned', 'words'),
    [
        (lambda picture: picture[::-1, ::-1], 'turned by 180 degrees'),
        (lambda picture: picture[:, ::-1], 'is mirrored against'),
        (lambda picture: picture[::-1], 'mirrored upside down'),
    ],
)
def test_a_turned_photograph_is_told(features, turned, words) -> None:
    nudged = moved(sand(1), np.array([[1, 0, 3.0], [0, 1, 2.0], [0, 0, 1]]))
    with pytest.raises(InputError, match=words):
        align(np.ascontiguousarray(turned(nudged)), features)


@pytest.mark.parametrize('seed', (2, 3))
def test_other_sand_is_refused(features, seed: int) -> None:
    with pytest.raises(InputError, match='does not match the baseline'):
        align(sand(seed), features)


def test_a_baseline_without_texture_is_refused() -> None:
    with pytest.raises(InputError, match='no texture'):
        reference_features(
            np.full((ROWS, COLUMNS, 3), 90, np.uint8), np.ones((ROWS, COLUMNS), bool)
        )


def test_a_shift_and_a_deformation_are_reported_in_pixels_of_the_file() -> None:
    found = Alignment(np.eye(3), shift=1.5, residual=0.5, inliers=0.9)
    moved_line, deformed_line = alignment_remarks(found, reduction=2)
    assert moved_line == 'camera has moved by 3.0 px: corrected'
    assert deformed_line.startswith('alignment leaves 1.0 px')
    assert alignment_remarks(Alignment(np.eye(3), 1.0, 0.1, 0.9), reduction=2) == []
