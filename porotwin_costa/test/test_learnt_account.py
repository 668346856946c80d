"""The account of a training: shares of the gap."""

from dataclasses import replace

import pytest
from toy_solver import SPEED, STEP_S, MovingTracers, delayed, moving_frames

from porotwin_costa.correction.free_run_gate import Judge, KeptRun
from porotwin_costa.evaluation.learnt_account import gap_shares
from porotwin_costa.networks import architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.training import train


@pytest.fixture
def corrective(dataset):
    return train(dataset, architecture('local'), TrainingSettings(epochs=1, patience=40), seed=3)


def test_a_named_effect_and_learnt_physics_share_the_gap(corrective, grid):
    run = [KeptRun(moving_frames(grid, 25, speed=0.8 * SPEED), 0.0)]
    bare, named = (Judge(MovingTracers(by * SPEED), run, STEP_S) for by in (1.0, 0.85))
    rest = delayed(0.85 / 0.8)
    found = gap_shares(bare, named, replace(corrective, trust=0.0, learnt=rest))
    assert found['named effects'] > 0.5
    assert found['learnt physics and scheme'] > 0.05
    assert found['network'] == 0.0
    assert found['remainder'] == pytest.approx(0.0, abs=1e-3)
    assert sum(found.values()) == pytest.approx(1.0)
