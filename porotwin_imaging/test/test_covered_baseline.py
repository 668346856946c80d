"""A hand before the baseline is told apart from one before later photographs."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.baseline.covered_baseline import uncovered
from porotwin_imaging.photo_to_map import concentration_map

HAND = (slice(300, 460), slice(400, 560))
"""Rows and columns of a hand [px]."""
SKIN = (0.6, 0.36, 0.24)


def readers(*photographs: bytes) -> list[Callable[[], bytes]]:
    """Return a function for each photograph that reads it."""
    return [partial(bytes, photograph) for photograph in photographs]


@pytest.fixture
def plumes(laboratory, make_plume, true_shape) -> list[np.ndarray]:
    """Return the light of three photographs of a growing plume."""
    return [laboratory.scene(make_plume(true_shape, 0.77, 0.25, 0.03 * n)) for n in (1, 2, 3)]


@pytest.fixture
def covered(laboratory, calibration, no_tracer, make_jpeg) -> Baseline:
    light = laboratory.scene(no_tracer)
    light[HAND] = SKIN
    grid = laboratory.rig.grid(90, 50)
    return make_baseline(laboratory.rig, grid, [make_jpeg(light)], calibration=calibration)


def test_a_hand_in_the_baseline_is_named_and_left_out(
    covered, plumes, make_jpeg, make_plume, true_shape, relative_error
) -> None:
    photographs = [make_jpeg(light, seed=number) for number, light in enumerate(plumes)]
    sound, cover = uncovered(covered, readers(*photographs), ['base.jpg'])
    assert cover is not None
    assert cover.code == 'covered_baseline'
    assert (cover.facts['files'], cover.facts['photographs']) == (' base.jpg', 3)
    before = concentration_map(photographs[-1], covered)
    assert any('is covered or damaged' in line for line in before.status)
    found = concentration_map(photographs[-1], sound)
    assert not any('covered' in line for line in found.status)
    hand = np.zeros((50, 90), bool)
    hand[50 - 30 : 50 - 19, 41:56] = True
    assert np.isnan(found.values[hand]).all()
    assert np.isfinite(found.values).mean() > 0.8
    assert relative_error(found.values, make_plume(true_shape, 0.77, 0.25, 0.09)) < 0.05


def test_an_object_before_all_later_photographs_is_no_fault_of_the_baseline(
    baseline, plumes, make_jpeg
) -> None:
    for light in plumes:
        light[HAND] = SKIN
    photographs = [make_jpeg(light, seed=number) for number, light in enumerate(plumes)]
    assert uncovered(baseline, readers(*photographs)) == (baseline, None)


def test_hands_that_come_and_go_are_no_fault_of_the_baseline(baseline, plumes, make_jpeg) -> None:
    plumes[1][HAND] = SKIN
    photographs = [make_jpeg(light, seed=number) for number, light in enumerate(plumes)]
    assert uncovered(baseline, readers(*photographs)) == (baseline, None)


def test_one_photograph_does_not_accuse_the_baseline(covered, plumes, make_jpeg) -> None:
    good, broken = make_jpeg(plumes[0]), b'no photograph'
    assert uncovered(covered, readers(good, broken))[1] is None


def test_a_baseline_that_is_covered_by_half_is_refused(
    laboratory, calibration, no_tracer, make_jpeg, plumes
) -> None:
    light = laboratory.scene(no_tracer)
    light[:, 450:] = SKIN
    grid = laboratory.rig.grid(90, 50)
    half = make_baseline(laboratory.rig, grid, [make_jpeg(light)], calibration=calibration)
    photographs = [make_jpeg(one, seed=number) for number, one in enumerate(plumes)]
    with pytest.raises(InputError, match=r'baseline base\.jpg'):
        uncovered(half, readers(*photographs), ['base.jpg'])
