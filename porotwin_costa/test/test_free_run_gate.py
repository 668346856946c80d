"""The gate judges free runs, not single steps."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from costa_examples import injecting
from toy_solver import SPEED, STEP_S, MovingTracers, delayed, moving_frames

from porotwin_core.basis.errors import InputError
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import Schedule
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.free_run_gate import (
    Judge,
    KeptRun,
    RunErrors,
    corrector,
    faster,
    gated,
    kept_runs,
    nearly_best,
)
from porotwin_costa.networks import CorrectiveNetwork, architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.training import train

SLOWER = delayed(1.25)
FASTER = delayed(0.8)


@pytest.fixture
def judge(grid) -> Judge:
    frames = moving_frames(grid, 25, speed=0.8 * SPEED)
    return Judge(MovingTracers(), [KeptRun(frames, 0.0)], STEP_S)


@pytest.fixture
def silent(dataset) -> CorrectiveModel:
    model = train(dataset, architecture('hybrid'), TrainingSettings(epochs=1, patience=40), seed=3)
    return replace(model, trust=0.0)


def test_right_physics_opens_the_gate(judge, silent):
    found = gated(replace(silent, learnt=SLOWER), judge)
    assert found.learnt == SLOWER
    assert 'gate open for learnt physics' in found.summary
    assert found.provenance['gate']['corrected'] < 0.01


def test_wrong_physics_shuts_it(judge, silent):
    found = gated(replace(silent, learnt=FASTER), judge)
    assert found.learnt is None
    assert found.trust == 0.0
    assert 'gate shut' in found.summary


class AddingTracer(CorrectiveNetwork):
    """Adds tracer while the pumps run, or during pauses."""

    def __init__(self, *, at_rest):
        super().__init__()
        self.at_rest = at_rest

    def forward(self, concentration, rates):
        acts = bool(rates.abs().sum() == 0.0) == self.at_rest
        return torch.full_like(concentration, 0.1 if acts else 0.0)


def test_a_network_that_moves_tracer_during_a_pause_is_not_trusted(grid, silent):
    frames = replace(
        moving_frames(grid, 25), schedule=Schedule.constant(injecting(left=200.0, right=200.0))
    )
    judge = Judge(MovingTracers(), [KeptRun(frames, 0.0)], STEP_S)
    model = replace(silent, trust=1.0)
    assert judge.rests(replace(model, network=AddingTracer(at_rest=False)))
    assert not judge.rests(replace(model, network=AddingTracer(at_rest=True)))


@pytest.mark.parametrize('count', [3, 4])
def test_a_kept_run_that_is_too_short_for_other_rates_is_judged(grid, silent, count):
    frames = moving_frames(grid, count, speed=0.8 * SPEED)
    judge = Judge(MovingTracers(), [KeptRun(frames, 0.0)], STEP_S)
    harmless = replace(silent, network=AddingTracer(at_rest=False), learnt=SLOWER)
    found = gated(harmless, judge)
    assert found.trust == 1.0
    assert 2.0 not in found.provenance['gate']['rates_passed']


def test_kept_runs_without_tracer_are_refused(grid):
    frames = moving_frames(grid, 10)
    empty = replace(frames, concentration=np.zeros_like(frames.concentration))
    Judge(MovingTracers(), [KeptRun(frames, 0.0), KeptRun(empty, 0.0)], STEP_S).check()
    with pytest.raises(InputError, match='no map that is kept to judge COSTA shows tracer'):
        Judge(MovingTracers(), [KeptRun(empty, 0.0)], STEP_S).check()


def test_one_frame_that_is_worse_is_harmful():
    alone = np.array([0.2, 0.2, 0.2])
    assert RunErrors(alone, np.array([0.05, 0.05, 0.2])).harmless
    assert not RunErrors(alone, np.array([0.01, 0.01, 0.21])).harmless


def test_the_whole_network_is_taken_unless_half_of_it_is_clearly_better(silent):
    def found(whole, half):
        errors = [RunErrors(np.ones(3), np.full(3, error)) for error in (whole, half)]
        tried = [replace(silent, trust=trust) for trust in (1.0, 0.5)]
        return nearly_best(list(zip(tried, errors, strict=True)))[0].trust

    assert found(0.105, 0.1) == 1.0
    assert found(0.12, 0.1) == 0.5


def test_twice_the_rates_give_the_maps_twice_as_fast(grid):
    run = KeptRun(moving_frames(grid, 21), 300.0)
    quick = faster(run, 2.0, STEP_S)
    assert np.array_equal(quick.frames.concentration, run.frames.concentration[::2])
    assert quick.judged_from == 150.0
    assert len(faster(run, 0.5, STEP_S).frames.times) == 41


def test_the_end_of_a_single_experiment_is_kept(grid):
    one = moving_frames(grid, 20)
    learning, kept = kept_runs([one], 0.2)
    assert len(learning[0].times) == 16
    assert kept[0].frames is not None
    assert kept[0].judged_from == learning[0].times[-1]
    learning, kept = kept_runs([one, one, one], 0.2)
    assert (len(learning), len(kept)) == (2, 1)


def test_a_thousand_corrected_steps_stay_within_bounds_and_keep_the_tracer(dataset, grid):
    small = architecture('local').described({'filters': 2})
    model = replace(
        train(dataset, small, TrainingSettings(epochs=1, patience=40), seed=3), trust=1.0
    )
    solver, rates = MovingTracers(), {}
    correct, plain = corrector(model, solver), solver.model(LearntPhysics())
    state = moving_frames(grid, 1).concentration[0]
    tracer = state.sum()
    for _ in range(1000):
        state = correct(plain, state, plain.predict(state, rates, STEP_S), rates, STEP_S)
    assert state.min() >= 0.0
    assert state.max() <= 1.0
    assert state.sum() == pytest.approx(tracer, rel=1e-6)
