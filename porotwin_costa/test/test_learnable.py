"""The effects that may be learnt, and the physics that they make."""

import numpy as np
from toy_solver import MovingTracers, moving_frames

from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_costa.physics.learnable import Learnable, physics_of, with_part


def test_all_parts_take_their_steps_from_one_array(grid):
    learnable = Learnable.of(MovingTracers(), grid, [moving_frames(grid, 3)])
    (part,) = learnable.everywhere()
    found = physics_of([part, part], np.array([0.0, 2.0]))
    assert [one.parameters['retardation_factor'] for one in found.effects] == [1.0, 1.04]
    assert with_part(LearntPhysics(scheme='fast'), part, [2.0]).effects == found.effects[1:]
    assert learnable.duration == 60.0


def test_places_are_spread_over_the_rig(grid):
    places = list(Learnable(MovingTracers(), grid, 60.0, 1e-7).places())
    assert len(places) > 100
    assert all(0 < x < grid.width and 0 < z < grid.height for x, z in places)
