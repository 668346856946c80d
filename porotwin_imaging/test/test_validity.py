"""Cells that do not show the sand of the baseline have no value."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map


def test_glare_is_nan(baseline, laboratory, no_tracer, make_jpeg) -> None:
    light = laboratory.scene(no_tracer)
    light[320:360, 300:360] = 1.0
    values = concentration_map(make_jpeg(light, noise=0.0), baseline).values
    x, z = int((330 - 40) / 9), int((150 + 450 - 340) / 9)
    assert np.isnan(values[z, x])
    assert np.isfinite(values).mean() > 0.97


@pytest.mark.parametrize('grid', [(90, 50), (400, 222)])
def test_a_hand_in_front_of_the_sand_is_nan(
    laboratory, calibration, empty_photograph, make_plume, true_shape, make_jpeg, relative_error,
    grid,
) -> None:  # fmt: skip
    rig = laboratory.rig
    baseline = make_baseline(rig, rig.grid(*grid), [empty_photograph], calibration=calibration)
    truth = make_plume(true_shape, 0.6, 0.25, 0.1)
    light = laboratory.scene(truth)
    light[300:640, 150:300] = [0.1, 0.06, 0.04]
    found = concentration_map(make_jpeg(light, noise=0.0), baseline)
    hand = (slice(0, int(0.55 * grid[1])), slice(int(0.15 * grid[0]), int(0.27 * grid[0])))
    assert np.isnan(found.values[hand]).all()
    assert relative_error(found.values, truth) < 0.05
    assert found.suspicious
    assert any('is covered or' in line for line in found.status)


@pytest.mark.parametrize('share', [0.5, 0.85])
def test_a_damaged_file_is_refused(baseline, laboratory, no_tracer, share: float) -> None:
    data = bytearray(laboratory.photograph(no_tracer, seed=3))
    place = int(share * len(data))
    data[place : place + 3000] = bytes(3000)
    with pytest.raises(InputError, match='is broken'):
        concentration_map(bytes(data), baseline)
