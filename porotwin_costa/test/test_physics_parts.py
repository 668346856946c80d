"""The parts of learnt physics and their unknowns."""

import numpy as np
import pytest

from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_costa.physics.physics_parts import LearntUnknown, PartMaker, physics_of


@pytest.fixture
def maker(rig, grid):
    return PartMaker(rig, grid, 3600.0, 1e-7)


def test_an_unknown_is_a_step_from_its_origin():
    assert LearntUnknown(0.5, 2.0).value(3.0) == 3.5
    assert LearntUnknown(0.1, np.log(0.05), log=True).value(0.0) == pytest.approx(0.05)


def test_parts_at_zero_change_nothing(maker):
    parts = maker.everywhere()
    count = sum(len(part.unknowns) for part in parts)
    assert physics_of(parts, np.zeros(count)) == LearntPhysics()


def test_a_place_stays_inside_the_rig(maker, grid):
    part = maker.patch_at(0.3, 0.2, -1.0)
    far = np.array([unknown.high for unknown in part.unknowns])
    (patch,) = physics_of([part], far).patches
    assert 0 < patch.x < grid.width
    assert 0 < patch.z < grid.height
    (first,) = physics_of([part], part.first).patches
    assert (first.x, first.z) == pytest.approx((0.3, 0.2))
    assert first.log_factor < 0


def test_a_leak_starts_as_a_source_or_a_sink(maker):
    (leak,) = physics_of([one := maker.leak_at(0.3, 0.2, -1.0)], one.first).leaks
    assert leak.rate < 0
    assert all(0 < x < 0.6 and 0 < z < 0.4 for x, z in maker.places())
