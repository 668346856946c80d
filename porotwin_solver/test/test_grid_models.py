"""Tests of the model on its own grid and on a coarser one."""

import pytest

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import EffectDescription
from porotwin_solver.grid_models import GridModels, refuse_another_size


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
