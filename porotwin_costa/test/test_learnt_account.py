"""The account of a training: shares of the gap, and the effects that a sigma looks like."""

from dataclasses import replace

import numpy as np
import pytest
from toy_solver import SPEED, STEP_S, MovingTracers, delayed, moving_frames

from porotwin_costa.correction.free_run_gate import Judge, KeptRun
from porotwin_costa.networks import architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.physics.learnt_account import EffectSources, gap_shares, look_alikes, matched
from porotwin_costa.training.training import train


@pytest.fixture
def corrective(dataset):
    return train(dataset, architecture('local'), TrainingSettings(epochs=1, patience=40), seed=3)


def test_the_effects_of_a_mixture_are_told_apart():
    random = np.random.default_rng(8)
    drift, density, leak = random.standard_normal((3, 400, 1))
    found = matched(
        2.0 * drift[:, 0] + density[:, 0],
        [
            EffectSources('drift', drift),
            EffectSources('density', density),
            EffectSources('leak', leak),
        ],
    )
    assert found.shares == pytest.approx({'drift': 0.8, 'density': 0.2}, abs=0.1)
    assert found.unexplained < 1e-9
    assert 'looks like 8' in found.text


def test_noise_looks_like_no_effect():
    random = np.random.default_rng(8)
    noise, drift = random.standard_normal(400), random.standard_normal((400, 1))
    assert matched(noise, [EffectSources('drift', drift)]).shares == {}


def test_a_sigma_is_compared_with_the_sources_of_effects(corrective, grid):
    frames = moving_frames(grid, 15)
    found = look_alikes(corrective, [frames], MovingTracers())
    assert sum(found.shares.values()) + found.unexplained == pytest.approx(1.0)
    assert set(found.shares) <= {'retardation'}  # the toy solver has no other effect
    silent = look_alikes(replace(corrective, trust=0.0), [frames], MovingTracers())
    assert silent.unexplained == 1.0


def test_a_named_effect_and_costa_share_the_gap(corrective, grid):
    run = [KeptRun(moving_frames(grid, 25, speed=0.8 * SPEED), 0.0)]
    bare, named = (Judge(MovingTracers(by * SPEED), run, STEP_S) for by in (1.0, 0.85))
    rest = delayed(0.85 / 0.8)
    found = gap_shares(bare, named, replace(corrective, trust=0.0, learnt=rest))
    assert found['named effects'] > 0.5
    assert found['COSTA'] > 0.05
    assert found['remainder'] == pytest.approx(0.0, abs=1e-3)
    assert sum(found.values()) == pytest.approx(1.0)
