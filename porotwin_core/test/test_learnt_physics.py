"""Learnt physics as plain numbers."""

import json

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.learnt_physics import LearntLeak, LearntPhysics, SandPatch

GRID = Grid(40, 20, 0.8, 0.4)


def test_a_description_survives_json() -> None:
    learnt = LearntPhysics(
        density_difference=0.5,
        background_flux=(1e-7, 0.0),
        leaks=(LearntLeak(0.1, 0.2, 1e-9),),
        patches=(SandPatch(0.3, 0.2, 0.05, -1.5),),
        scheme='accurate',
    )
    described = json.loads(json.dumps(learnt.description()))
    assert LearntPhysics.from_description(described) == learnt


def test_a_patch_changes_the_sand_inside_its_radius_only() -> None:
    factor = LearntPhysics(patches=(SandPatch(0.4, 0.2, 0.1, -1.0),)).permeability_factor(GRID)
    assert np.isclose(factor[10, 20], np.exp(-1.0), rtol=1e-3)
    assert np.isclose(factor[0, 0], 1.0)
    assert (LearntPhysics().permeability_factor(GRID) == 1.0).all()


@pytest.mark.parametrize(
    ('wrong', 'complaint'),
    [
        (LearntPhysics(background_flux=(np.nan, 0.0)), 'background_flux: not a finite number'),
        (LearntPhysics(leaks=(LearntLeak(0.1, 0.2, np.inf),)), 'leaks: not a finite number'),
        (LearntPhysics(density_difference=2e3), 'density_difference: 2000 is not from -1000'),
        (LearntPhysics(longitudinal_dispersivity=-1e-3), 'dispersivity: -0.001 is not from 0 to 1'),
        (LearntPhysics(transverse_dispersivity=2.0), 'dispersivity: 2 is not'),
        (LearntPhysics(background_flux=(0.0, 1.0)), 'background_flux: 1 is not'),
        (LearntPhysics(log_retardation=710.0), 'log_retardation: 710 is not from -4.6 to 4.6'),
        (LearntPhysics(leaks=(LearntLeak(0.1, 0.2, 1e3),)), 'rate of a leak: 1000 is not'),
        (LearntPhysics(patches=(SandPatch(0.3, 0.2, 1e-300, 1.0),)), 'radius of a patch: 1e-300'),
        (LearntPhysics(patches=(SandPatch(0.3, 0.2, 0.1, -60.0),)), 'log_factor of a patch: -60'),
    ],
)
def test_physics_that_no_model_can_have_is_refused(wrong: LearntPhysics, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        wrong.check()
