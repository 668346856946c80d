"""Corners that were read in a smaller copy or lie off the sand are odd; others are not."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig, load_rig
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.baseline.corner_check import corners_off_the_sand, small_rig

CORNERS = [(100.0, 105.0), (98.0, 585.0), (902.0, 592.0), (898.0, 104.0)]
SIZE = (1000, 700)
NO_TRACER = np.zeros((2, 2))


@pytest.mark.parametrize(
    ('factor', 'shift', 'share', 'in_quarter'),
    [
        (1.0, 0.0, None, False),
        (0.5, 0.0, 0.14, True),
        (0.25, 0.0, 0.035, True),
        (0.5, 250.0, None, False),  # in the middle of a wide view
        (0.3, 300.0, 0.05, False),
    ],
)
def test_corners_of_a_smaller_copy_are_odd(
    factor: float, shift: float, share: float | None, in_quarter: bool
) -> None:
    corners = [(factor * x + shift, factor * y + shift / 2) for x, y in CORNERS]
    found = small_rig(corners, SIZE)
    assert (found is None) == (share is None)
    if found is not None:
        assert found.facts['share'] == pytest.approx(share, abs=0.005)
        assert bool(found.facts['quarter']) == in_quarter


def with_corners(rig: Rig, corners: np.ndarray) -> Rig:
    """Return `rig` with other corners [px]."""
    assert rig.camera is not None
    pixels = tuple((float(column), float(row)) for column, row in corners)
    return rig.model_copy(update={'camera': rig.camera.model_copy(update={'corners_px': pixels})})


@pytest.mark.parametrize('number', [0, 1, 2, 3])
def test_a_corner_off_the_sand_is_named_with_its_place(laboratory, number) -> None:
    clear = replace(laboratory, chart_at=(60, 12))  # with its chart farther from the sand
    rig, photograph = clear.rig, clear.photograph(NO_TRACER)
    assert rig.camera is not None
    true = np.array(rig.camera.corners_px)
    corners = true.copy()
    corners[number] += 14 * np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])[number]
    grid = rig.grid(60, 33)
    assert not any('corners' in one for one in make_baseline(rig, grid, [photograph]).remarks)
    told = make_baseline(with_corners(rig, corners), grid, [photograph]).remarks[0]
    names = ('upper left', 'lower left', 'lower right', 'upper right')
    assert [name for name in names if name in told] == [names[number]]
    column, row = (int(word) for word in told.split('[')[1].split(']')[0].split(', '))
    assert np.hypot(*(np.array([column, row]) - true[number])) < 6
    assert told.startswith('camera.corners_px in rig.yaml: ')


def test_corners_far_from_the_sand_are_told(laboratory) -> None:
    assert laboratory.rig.camera is not None
    true = np.array(laboratory.rig.camera.corners_px)
    pixels = cv2.imdecode(np.frombuffer(laboratory.photograph(NO_TRACER), np.uint8), 1)
    middle = true.mean(axis=0)
    assert corners_off_the_sand(laboratory.rig, pixels, 1) is None
    lost = with_corners(laboratory.rig, middle + 0.6 * (true - middle))
    off = corners_off_the_sand(lost, pixels, 1)
    assert off is not None and off.code == 'corners_off_sand'


def test_a_dark_baseline_asks_for_its_corners_too(laboratory) -> None:
    dark = laboratory.photograph(NO_TRACER, gain=0.05)
    with pytest.raises(InputError, match=r'shows no sand: .*corners_px in rig.yaml wrong'):
        make_baseline(laboratory.rig, laboratory.rig.grid(60, 33), [dark])


def test_corners_of_real_photographs_are_right_or_told(tracer_photographs) -> None:
    rig = load_rig(tracer_photographs)
    assert rig.camera is not None
    pixels = cv2.imread(str(tracer_photographs / 'tracer_0.jpg'))
    assert corners_off_the_sand(rig, pixels, 1) is None
    corners = np.array(rig.camera.corners_px) + 48 * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    told = str(corners_off_the_sand(with_corners(rig, corners), pixels, 1))
    assert told.count('near') == 4
