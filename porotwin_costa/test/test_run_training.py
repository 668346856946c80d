"""Training from maps: the pairs are the same, whoever prepares them."""

from dataclasses import replace

import numpy as np
from toy_solver import STEP_S, MovingTracers, moving_frames

from porotwin_core.learnt_physics import LearntPhysics
from porotwin_core.parallel import ThreadCrew
from porotwin_costa.run_training import Experiments


def _solver(_grid):
    return MovingTracers()


def test_workers_prepare_the_pairs_of_one_process(rig, grid):
    frames = [moving_frames(grid, count, at=at) for count, at in ((6, 0.2), (4, 0.5))]
    with ThreadCrew(1) as alone, ThreadCrew(2) as pool:
        here = Experiments(rig, grid, frames, STEP_S, '', _solver, _solver, alone)
        one = here.pairs(frames, LearntPhysics())
        both = replace(here, pool=pool).pairs(frames, LearntPhysics())
    assert np.array_equal(one.residual, both.residual)
    assert np.array_equal(one.experiment, both.experiment)
    assert one.sources == both.sources
    assert one.fingerprint == both.fingerprint
