"""Training from maps: the pairs are the same, whoever prepares them."""

from dataclasses import replace

import numpy as np
import pytest
from toy_solver import SPEED, STEP_S, MovingTracers, delayed, moving_frames

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import ThreadCrew
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rig.sections import LevelCourse
from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.networks import architecture
from porotwin_costa.training.run_training import Experiments, TrainingChoice, train_from_runs

QUICK = TrainingChoice(architecture('hybrid').described({'filters': 2}), 3, epochs=1, curriculum=())


def _solver(_grid):
    return MovingTracers()


def _slow(_grid):
    return MovingTracers(0.8 * SPEED)


def _none(*_):
    pytest.fail('the work began')


def _nothing(_learning, _say):
    return ()


def test_levels_that_change_are_refused_before_the_work(rig, grid):
    tidal = rig.model_copy(update={'levels': {'sea': LevelCourse(points=((40, 0.29),))}})
    frames = [moving_frames(grid, 12, at=0.2)]
    with ThreadCrew(1) as pool, pytest.raises(InputError, match='levels'):
        data = Experiments(tidal, grid, frames, STEP_S, '', _none, _none, pool)
        train_from_runs(data, TrainingChoice(architecture('local'), 3))
    with pytest.raises(InputError, match='levels'):
        build_dataset(frames, tidal, grid=grid, time_step=STEP_S, predict=_none, residual=_none)


def test_workers_prepare_the_pairs_of_one_process(rig, grid):
    frames = [moving_frames(grid, count, at=at) for count, at in ((6, 0.2), (4, 0.5))]
    with ThreadCrew(1) as alone, ThreadCrew(2) as pool:
        here = Experiments(rig, grid, frames, STEP_S, '', _solver, _nothing, alone)
        one = here.pairs(frames, LearntPhysics())
        both = replace(here, pool=pool).pairs(frames, LearntPhysics())
    assert np.array_equal(one.residual, both.residual)
    assert np.array_equal(one.experiment, both.experiment)
    assert one.sources == both.sources
    assert one.fingerprint == both.fingerprint


@pytest.mark.parametrize(('solver', 'scheme'), [(_slow, 'sharper'), (_solver, '')])
def test_a_sharper_scheme_is_learnt_where_free_runs_need_it(rig, grid, solver, scheme):
    frames = [moving_frames(grid, 12, at=at) for at in (0.2, 0.3)]
    with ThreadCrew(1) as pool:
        data = Experiments(rig, grid, frames, STEP_S, '', solver, _nothing, pool, 'sharper')
        model = train_from_runs(data, QUICK)
    assert (model.learnt.scheme if model.learnt else '') == scheme
    assert ('the scheme sharper' in model.provenance['gate']['says']) == bool(scheme)


@pytest.mark.parametrize(('speed', 'learnt'), [(0.8, True), (1.0, False)])
def test_found_physics_is_learnt_where_kept_runs_get_better(rig, grid, speed, learnt):
    frames = [moving_frames(grid, 12, speed=speed * SPEED, at=at) for at in (0.2, 0.3)]
    asked, delay = [], delayed(1.25)

    def found(learning, _say):
        asked.extend(one.name for one in learning)
        return delay.effects

    with ThreadCrew(1) as pool:
        data = Experiments(rig, grid, frames, STEP_S, '', _solver, found, pool)
        model = train_from_runs(data, QUICK)
    assert asked == [frames[0].name]  # the last one judges
    assert model.learnt == (delay if learnt else None)
