"""Flaws of composed calibrations: their list and their disturbances."""

import numpy as np
import pytest

from lab.photographs.photo_flaws import FLAWS, OBSTACLES, WITHHELD_KIND, drawn_obstacle

SCENE = np.full((90, 160, 3), 0.2, np.float32)


def test_the_twenty_cases_know_their_flaws_and_most_must_be_used() -> None:
    assert len(WITHHELD_KIND) == 20
    assert set(WITHHELD_KIND) <= set(FLAWS)
    assert sum(FLAWS[name].expected == 'use' for name in WITHHELD_KIND) > 10


@pytest.mark.parametrize('name', OBSTACLES)
def test_a_disturbance_changes_a_part_of_the_scene_and_can_be_repeated(name) -> None:
    changed = drawn_obstacle(name, np.random.default_rng(3))(SCENE)
    again = drawn_obstacle(name, np.random.default_rng(3))(SCENE)
    np.testing.assert_array_equal(changed, again)
    assert changed.shape == SCENE.shape
    touched = np.abs(changed - SCENE).max(axis=2) > 0.01
    assert 0.005 < touched.mean() < 0.9


def test_a_shadow_darkens_and_a_reflection_brightens() -> None:
    shadow = drawn_obstacle('shadow', np.random.default_rng(1))(SCENE)
    glare = drawn_obstacle('glare', np.random.default_rng(1))(SCENE)
    assert shadow.max() <= SCENE.max()
    assert glare.min() >= SCENE.min()
