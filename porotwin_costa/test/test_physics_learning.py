"""Physics is learnt from free runs, and only as much as kept runs gain by."""

import pytest
from toy_solver import SPEED, MovingTracers, moving_frames

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import ThreadCrew
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_costa.physics.physics_learning import Solvers, learn_physics, no_finer

SOLVERS = Solvers(lambda _: MovingTracers(), lambda _: MovingTracers())


def _learn(grid, speed, starts=(0.2, 0.3), workers=1):
    frames = [moving_frames(grid, 30, speed=speed, at=at) for at in starts]
    said = []
    with ThreadCrew(workers) as pool:
        learnt = learn_physics(grid, frames, SOLVERS, pool=pool, say=said.append)
    return learnt, said


@pytest.mark.parametrize('starts', [(0.2, 0.3), (0.2,)])
def test_a_slower_tracer_is_learnt_as_sorption(grid, starts):
    learnt, said = _learn(grid, 0.8 * SPEED, starts)
    (delay,) = learnt.effects
    assert delay.parameters['retardation_factor'] == pytest.approx(1.25, rel=0.02)
    assert 'learnt retardation' in said[0]
    assert _learn(grid, 0.8 * SPEED, starts, workers=2) == (learnt, said)


def test_nothing_is_learnt_where_nothing_is_missing(grid):
    learnt, said = _learn(grid, SPEED)
    assert learnt == LearntPhysics()
    assert 'lacks no physics' in said[-1]


def test_two_maps_are_too_few(grid):
    few = [moving_frames(grid, 2)]
    with ThreadCrew(1) as pool, pytest.raises(InputError, match='three consecutive maps'):
        learn_physics(grid, few, SOLVERS, pool=pool)


def test_parts_are_chosen_on_a_coarse_grid(rig):
    assert no_finer(rig.grid(180, 120), 96) == rig.grid(90, 60)
    assert no_finer(rig.grid(30, 20), 96) == rig.grid(30, 20)
