"""Training through free runs: the gradient is exact, and the weights get no worse."""

import numpy as np
import pytest
import torch
from toy_solver import SPEED, MovingTracer, moving_frames

from porotwin_costa.networks import architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.rollout_training import RollOuts, Run, Stage, train_through_runs
from porotwin_costa.training.training import train

LOCAL = architecture('local').described({'filters': 2})


@pytest.fixture
def frames(grid):
    return moving_frames(grid, 12, speed=0.8 * SPEED)


@pytest.fixture
def corrective(dataset):
    """Return a model with smooth activations, so that differences are exact slopes."""
    settings = TrainingSettings(epochs=1, batch_size=8, patience=40)
    model = train(dataset, LOCAL, settings, seed=3)
    for number, layer in enumerate(model.network.trunk):
        if isinstance(layer, torch.nn.ReLU):
            model.network.trunk[number] = torch.nn.Tanh()
    return model


def test_the_gradient_through_the_solver_is_the_slope_of_the_loss(corrective, frames):
    rollouts, run = RollOuts(corrective, MovingTracer()), Run.of(frames)
    weights = corrective.network.trunk[-1].bias
    corrective.network.double()
    corrective.network.float()
    corrective.network.zero_grad()
    rollouts.add_gradient(run, 2, 6)
    found = weights.grad.clone().numpy()
    losses = []
    for sign in (1.0, -1.0):
        with torch.no_grad():
            weights[0] += sign * 1e-2
        losses.append(rollouts.add_gradient(run, 2, 6))
        with torch.no_grad():
            weights[0] -= sign * 1e-2
    assert found[0] == pytest.approx((losses[0] - losses[1]) / 2e-2, rel=0.05)


def test_weights_that_are_not_better_are_not_kept(corrective, frames):
    before = {name: value.clone() for name, value in corrective.network.state_dict().items()}
    errors = iter([0.1, 0.2, 0.11])
    trained = train_through_runs(
        corrective,
        MovingTracer(),
        [frames],
        lambda _: next(errors),
        seed=1,
        curriculum=[Stage(3, 1, 1), Stage(5, 1, 1)],
    )
    after = trained.network.state_dict()
    assert all(torch.equal(before[name], after[name]) for name in before)
    assert trained.trust == corrective.trust


def test_uncertain_cells_count_less(frames):
    deviation = np.zeros_like(frames.concentration)
    deviation[:, 0] = 0.1
    uncertain = Run.of(type(frames)(frames.times, frames.concentration, frames.schedule, deviation))
    assert uncertain.weight[3, 0, 0] < 0.02 * uncertain.weight[3, 1, 0]
