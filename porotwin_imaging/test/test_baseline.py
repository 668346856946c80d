"""The baseline: several photographs, their orientation, and photographs that cannot be used."""

import dataclasses
import io

import cv2
import numpy as np
import pytest
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map

ORIENTATION_TAG = 0x0112


def test_an_orientation_that_is_not_applied_is_reported(laboratory, empty_photograph) -> None:
    file, tags = io.BytesIO(), Image.Exif()
    tags[ORIENTATION_TAG] = 3
    Image.open(io.BytesIO(empty_photograph)).save(file, 'JPEG', quality=95, exif=tags)
    grid = laboratory.rig.grid(90, 50)
    turned = make_baseline(laboratory.rig, grid, [file.getvalue()])
    assert any('EXIF orientation 3 is not applied' in line for line in turned.remarks)
    upright = make_baseline(laboratory.rig, grid, [empty_photograph])
    assert not any('EXIF' in line for line in upright.remarks)


def test_several_baselines_give_their_fluctuation(
    laboratory, calibration, no_tracer, true_map, relative_error
) -> None:
    photographs = [
        laboratory.photograph(no_tracer, gain=1 + 0.02 * n, shift=(0.7 * n, 0), seed=n)
        for n in range(3)
    ]
    rig = laboratory.rig
    baseline = make_baseline(rig, rig.grid(90, 50), photographs, calibration=calibration)
    assert not any('one baseline' in remark for remark in baseline.remarks)
    assert (baseline.fluctuation > 0).all()
    found = concentration_map(laboratory.photograph(true_map), baseline)
    assert relative_error(found.values, true_map) < 0.03


def test_a_baseline_needs_a_photograph_that_contains_the_rig(laboratory) -> None:
    grid = laboratory.rig.grid(90, 50)
    with pytest.raises(InputError, match='no baseline photograph'):
        make_baseline(laboratory.rig, grid, [])
    small = cv2.imencode('.jpg', np.full((100, 200, 3), 90, np.uint8))[1].tobytes()
    with pytest.raises(InputError, match='corners_px reach to'):
        make_baseline(laboratory.rig, grid, [small])


def test_a_photograph_turned_by_90_degrees_is_told(laboratory, empty_photograph) -> None:
    pixels = cv2.imdecode(np.frombuffer(empty_photograph, np.uint8), cv2.IMREAD_COLOR)
    turned = cv2.imencode('.jpg', cv2.rotate(pixels, cv2.ROTATE_90_CLOCKWISE))[1].tobytes()
    with pytest.raises(InputError, match='they fit a photograph that is turned by 90 degrees'):
        make_baseline(laboratory.rig, laboratory.rig.grid(90, 50), [turned])


def test_the_calibration_can_hide_parts_of_the_sand(
    laboratory, calibration, empty_photograph
) -> None:
    hidden = np.zeros((100, 180), np.uint8)
    hidden[:50] = 255  # row 0 of the picture is the top
    masked = dataclasses.replace(calibration, hidden=hidden)
    rig = laboratory.rig
    baseline = make_baseline(rig, rig.grid(90, 50), [empty_photograph], calibration=masked)
    values = concentration_map(empty_photograph, baseline).values
    assert np.isnan(values[26:]).all()
    assert np.isfinite(values[:24]).all()


@pytest.mark.parametrize('size', [(1, 1), (90, 2), (3, 50)])
def test_a_grid_of_few_cells_is_refused(laboratory, empty_photograph, size) -> None:
    with pytest.raises(InputError, match='is too coarse for photographs: it needs 4 columns'):
        make_baseline(laboratory.rig, laboratory.rig.grid(*size), [empty_photograph])


def test_the_coarsest_grid_is_imaged(laboratory, empty_photograph) -> None:
    baseline = make_baseline(laboratory.rig, laboratory.rig.grid(4, 4), [empty_photograph])
    assert concentration_map(empty_photograph, baseline).values.shape == (4, 4)
