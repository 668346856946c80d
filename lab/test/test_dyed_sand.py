"""Photographs composed on a baseline: what tracer, camera and sensor do to them."""

import cv2
import numpy as np
import pytest
from photo_examples import GRID, PICTURE, small_rig, textured_baseline

from lab.photographs.dyed_sand import (
    Dye,
    DyedSand,
    DyeResponse,
    Sensor,
    Shot,
    places,
    sands_of,
)
from porotwin_core.basis.errors import InputError

QUIET = Sensor(read=0.0, shot=0.0, quality=100)
DYE = Dye(np.array([[0, 0, 0], [1.2, 0.7, 1.4], [1.9, 1.3, 1.9]]))


def decoded(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).astype(int)


@pytest.fixture(scope='module')
def scene() -> DyedSand:
    rig, baseline = small_rig(), textured_baseline()
    return DyedSand(rig, baseline, sands_of(rig, baseline), DYE, QUIET)


def test_no_tracer_gives_the_baseline(scene) -> None:
    seen = decoded(scene.photograph(np.zeros(GRID), Shot(), seed=1))
    assert np.abs(seen - textured_baseline()).mean() < 1  # the file rounds


def test_more_tracer_is_darker_in_sand_and_nothing_outside(scene) -> None:
    rig = small_rig()
    inside = sands_of(rig, textured_baseline()) > 0
    means = [
        decoded(scene.photograph(np.full(GRID, level), Shot(), seed=1))[inside].mean()
        for level in (0.0, 0.2, 0.5, 1.0)
    ]
    assert (np.diff(means) < -1).all()
    stock = decoded(scene.photograph(np.ones(GRID), Shot(), seed=1))
    assert np.abs(stock - textured_baseline())[:8].mean() < 1  # the frame


def test_absorbance_of_stock_is_that_of_the_dye(scene) -> None:
    rig, baseline = small_rig(), textured_baseline()
    sands = sands_of(rig, baseline)
    stock = decoded(scene.photograph(np.ones(GRID), Shot(), seed=1))
    light = ((baseline + 14.025) / 269.025) ** 2.4
    dark = ((stock + 14.025) / 269.025) ** 2.4
    for number in (1, 2):
        seen = -np.log(dark[sands == number] / light[sands == number]).mean(axis=0)
        np.testing.assert_allclose(seen[::-1], DYE.absorption[number], rtol=0.06)


def test_the_same_seed_gives_the_same_file_and_another_seed_another(scene) -> None:
    noisy = DyedSand(
        small_rig(), textured_baseline(), sands_of(small_rig(), textured_baseline()), DYE
    )
    files = [noisy.photograph(np.zeros(GRID), Shot(), seed=seed) for seed in (1, 1, 2)]
    assert files[0] == files[1] != files[2]


def test_the_camera_moves_and_the_lamps_drift(scene) -> None:
    baseline = textured_baseline()
    moved = decoded(scene.photograph(np.zeros(GRID), Shot(shift=(4.0, 2.0)), seed=1))
    assert np.abs(moved[2:, 4:] - baseline[:-2, :-4]).mean() < 1
    bright = decoded(scene.photograph(np.zeros(GRID), Shot(gain=1.1), seed=1))
    assert 1.02 < bright.mean() / baseline.mean() < 1.08  # 10 % of linear light


def test_a_map_lies_where_the_camera_of_the_rig_says() -> None:
    across, up = places(small_rig(), PICTURE)
    corners = small_rig().camera.corners_px
    for (column, row), place in zip(corners, ((0, 1), (0, 0), (1, 0), (1, 1)), strict=True):
        found = across[int(row), int(column)], up[int(row), int(column)]
        np.testing.assert_allclose(found, place, atol=0.01)


def test_sands_are_levels_of_permeability_and_the_frame_is_none() -> None:
    sands = sands_of(small_rig(), textured_baseline())
    assert set(np.unique(sands)) == {0, 1, 2}
    assert sands[0, 0] == 0
    assert sands[100, 200] == 2  # upper half, more permeable
    assert sands[200, 200] == 1


@pytest.mark.parametrize('family', ['exponential', 'saturating', 'power'])
@pytest.mark.parametrize('bend', [0.3, 0.9, 1.2])
def test_a_response_rises_from_0_to_1(family, bend) -> None:
    curve = DyeResponse(family, bend)(np.linspace(0, 1, 50))
    assert curve[0] == 0
    assert curve[-1] == pytest.approx(1)
    assert (np.diff(curve) > 0).all()


def test_a_response_without_bend_is_straight() -> None:
    c = np.linspace(0, 1, 9)
    for response in (
        DyeResponse('exponential', 0.0),
        DyeResponse('saturating', 0.0),
        DyeResponse('power', 1.0),
    ):
        np.testing.assert_allclose(response(c), c, atol=1e-12)


def test_wrong_input_is_refused_in_a_line(scene) -> None:
    rig, baseline = small_rig(), textured_baseline()
    sands = sands_of(rig, baseline)
    with pytest.raises(InputError, match='NaN'):
        scene.photograph(np.full(GRID, np.nan), Shot(), seed=1)
    with pytest.raises(InputError, match='do not fit'):
        DyedSand(rig, baseline, sands[1:], DYE)
    with pytest.raises(InputError, match='3 sands; the dye knows 2'):
        DyedSand(rig, baseline, sands, Dye(DYE.absorption[:2]))
