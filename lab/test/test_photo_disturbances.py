"""Disturbances of photographs."""

import numpy as np
import pytest

from lab.photographs.photo_disturbances import DISTURBANCES

LIGHT = np.full((60, 100, 3), 0.3, np.float32)


@pytest.mark.parametrize('name', list(DISTURBANCES))
def test_a_disturbed_photograph_keeps_its_shape(name) -> None:
    assert DISTURBANCES[name](LIGHT).shape == LIGHT.shape


def test_a_shadow_takes_at_most_its_share_of_the_light() -> None:
    dark = DISTURBANCES['soft shadow of 40 % over a quarter'](LIGHT) / LIGHT
    assert dark.min() == pytest.approx(0.6, abs=0.01)
    assert (dark > 0.99).mean() > 0.5


def test_a_tube_hides_a_small_part_of_the_photograph() -> None:
    changed = DISTURBANCES['dark tube, 4 px'](LIGHT)[..., 0] < 0.2
    assert 0.0 < changed.mean() < 0.1


def test_a_moved_camera_does_not_see_what_lies_beyond_the_frame() -> None:
    moved = DISTURBANCES['camera moved by 60 px'](LIGHT)
    assert moved[:, :59].max() == 0.0
    assert moved[:, 61:].min() > 0.29
