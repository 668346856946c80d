"""Tests of the model on its own grid and on a coarser one."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import EffectDescription
from porotwin_solver.adjoint.grid_models import GridModels, refuse_another_size
from porotwin_solver.effects import EFFECTS


def test_a_coarser_grid_has_its_own_preset_and_is_kept(rig) -> None:
    models = GridModels(rig, rig.grid(31, 19), preset='upwind', coarse_preset='fast')
    assert models.on(rig.grid(31, 19)) is models.own
    coarse = models.on(rig.grid(15, 9))
    assert (coarse.preset, coarse.grid.shape) == ('fast', (9, 15))
    assert models.on(rig.grid(15, 9)) is coarse


def test_a_finer_grid_is_refused(rig) -> None:
    models = GridModels(rig, rig.grid(15, 9), preset='upwind', coarse_preset='fast')
    with pytest.raises(InputError, match='grid 31x19: has more cells'):
        models.on(rig.grid(31, 19))


def test_a_grid_of_another_size_is_refused_although_its_cells_are_as_many(rig) -> None:
    own = rig.grid(31, 19)
    models = GridModels(rig, own, preset='upwind', coarse_preset='fast')
    with pytest.raises(InputError, match=r'the rig of the solver is .*; give both the same rig'):
        models.on(Grid(31, 19, 2.0 * own.width, own.height))
    with pytest.raises(InputError, match='source field of'):
        refuse_another_size(Grid(31, 19, own.width, 1.01 * own.height), own, 'source field')
    assert models.on(Grid(31, 19, own.width * (1.0 + 1e-7), own.height)) is models.own


def test_effects_act_on_all_grids_and_leave_the_models_before_as_they_were(rig) -> None:
    models = GridModels(rig, rig.grid(15, 9), preset='upwind', coarse_preset='fast')
    sorbed = EffectDescription(name='retardation', parameters={'retardation_factor': 1.5})
    mended = models.with_effects([sorbed])
    for grid in (rig.grid(15, 9), rig.grid(7, 4)):
        assert mended.on(grid).physics.retardation_factor == 1.5
        assert models.on(grid).physics.retardation_factor == 1.0
    assert mended.with_effects([]).own.effects == models.own.effects


def test_learnt_physics_acts_in_the_cost_of_a_plan_and_in_its_slopes(rig) -> None:
    grid = rig.grid(15, 9)
    models = GridModels(rig, rig.grid(31, 19), preset='upwind', coarse_preset='fast')
    learnt = LearntPhysics(
        (
            EFFECTS['background_flow'].described(x_velocity=2e-7, z_velocity=1e-7),
            EFFECTS['leak'].described(x=0.3, z=0.2, rate=20.0),
        )
    )
    right = np.zeros(grid.shape)
    right[:, 8:] = 1.0
    terms = [CostTerm(0.0, 1200.0, linear=right)]
    well, *_ = rig.wells

    def cost(rate: float, physics: LearntPhysics) -> tuple[float, float]:
        plan = [RateStep(0.0, {well: WellRate(rate, 1.0)})]
        found, slopes = models.plan_cost(
            np.zeros(grid.shape),
            plan,
            horizon=1200.0,
            terms=terms,
            with_gradient=True,
            learnt=physics,
        )
        return found, float(slopes[0, 0])

    # a small difference: the cost jumps where the number of time steps changes
    rate, step = from_ml_h(400.0), from_ml_h(0.03)
    known, slope = cost(rate, learnt)
    bare, _ = cost(rate, LearntPhysics())
    assert abs(known - bare) > 0.01 * abs(bare)
    up, down = (cost(rate + sign * step, learnt)[0] for sign in (1, -1))
    assert slope == pytest.approx((up - down) / (2 * step), rel=1e-2)
    assert cost(rate, LearntPhysics())[0] == bare, 'the physics is asked for in every request'
