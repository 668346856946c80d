"""A training beside the twin replaces the model in use only if it is better."""

from dataclasses import replace

import numpy as np
import pytest
from toy_solver import POROSITY, SPEED, STEP_S, MovingTracer, MovingTracers, delayed, moving_frames

from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.networks import architecture
from porotwin_costa.training.live_training import LiveTraining, frames_of_pairs, not_used
from porotwin_costa.training.training import TrainingCancelledError


def _pairs(rig, grid, frames):
    plain = MovingTracer()
    return build_dataset(
        frames, rig, grid=grid, time_step=STEP_S, predict=plain.predict, residual=plain.residual
    )


def test_maps_are_found_again_in_the_pairs(rig, grid):
    frames = moving_frames(grid, 10, speed=0.8 * SPEED)
    (found,) = frames_of_pairs(_pairs(rig, grid, [frames]), MovingTracers())
    assert np.allclose(found.concentration, frames.concentration[1:], atol=1e-5)
    assert np.array_equal(found.times, frames.times[1:])
    assert POROSITY > 0


def test_a_good_model_is_not_replaced_by_a_worse_one(rig, grid, tmp_path):
    frames = [moving_frames(grid, 30, speed=0.8 * SPEED, at=at) for at in (0.2, 0.3)]
    pairs = _pairs(rig, grid, frames)
    live = LiveTraining(rig, '', MovingTracers())
    options = {
        'epochs': 1, 'seed': 3, 'progress': lambda _: None, 'cancelled': lambda: False,
    }  # fmt: skip
    first, _ = live.retrained(pairs, None, architecture('hybrid'), **options)
    right = delayed(1.25)
    good = replace(first, learnt=right, trust=0.0)
    again, is_better = live.retrained(pairs, good, architecture('hybrid'), **options)
    assert not is_better
    assert again.learnt == right
    assert not_used(tmp_path / 'a.b').name == 'a_not_used.b'


def test_a_training_that_is_cancelled_after_its_last_epoch_gives_no_model(rig, grid):
    frames = [moving_frames(grid, 30, speed=0.8 * SPEED, at=at) for at in (0.2, 0.3)]
    epochs = []
    with pytest.raises(TrainingCancelledError, match='stopped after its last epoch'):
        LiveTraining(rig, '', MovingTracers()).retrained(
            _pairs(rig, grid, frames),
            None,
            architecture('local'),
            epochs=1,
            seed=3,
            progress=epochs.append,
            cancelled=lambda: bool(epochs),
        )
