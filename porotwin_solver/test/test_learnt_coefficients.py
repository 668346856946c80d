"""Models with learnt physics: the same as with the effects that do the same; exact adjoint."""

import numpy as np
import pytest
from solver_cases import two_well_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.adjoint.learnt_coefficients import LearntModels
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.model import Model

RATES = {
    'injector': WellRate(from_ml_h(500.0), 1.0),
    'producer': WellRate(-from_ml_h(400.0)),
}
EVERYTHING = LearntPhysics(
    (
        EFFECTS['buoyancy'].described(density_difference=1.0),
        EFFECTS['dispersion'].described(
            longitudinal_dispersivity=1e-3, transverse_dispersivity=1e-4
        ),
        EFFECTS['background_flow'].described(x_velocity=2e-7, z_velocity=-1e-7),
        EFFECTS['retardation'].described(retardation_factor=1.1),
        EFFECTS['leak'].described(x=0.3, z=0.2, rate=20.0),
        EFFECTS['heterogeneity'].described(x=0.2, z=0.2, radius=0.06, permeability_factor=0.37),
    )
)


@pytest.fixture(scope='module')
def rig() -> Rig:
    return two_well_rig()


@pytest.fixture(scope='module')
def grid(rig: Rig) -> Grid:
    return rig.grid(25, 15)


@pytest.fixture(scope='module')
def plume(rig: Rig, grid: Grid) -> FloatArray:
    return Model(rig, grid, preset='fast').predict(np.zeros(grid.shape), RATES, 900.0)


@pytest.mark.parametrize(
    ('effect', 'parameters'),
    [
        ('buoyancy', {'density_difference': 1.5}),
        ('retardation', {'retardation_factor': 1.2}),
        ('background_flow', {'x_velocity': 2e-7, 'z_velocity': 1e-7}),
        ('leak', {'x': 0.3, 'z': 0.2, 'rate': 30.0}),
    ],
)
def test_learnt_physics_does_what_the_effect_does(
    rig: Rig, grid: Grid, effect: str, parameters: dict[str, float | str]
) -> None:
    named = EffectDescription(name=effect, parameters=parameters)
    wanted = Model(rig, grid, preset='fast', effects=[named])
    found = LearntModels(rig, grid, 'fast').model(LearntPhysics((named,)))
    state = np.zeros(grid.shape)
    assert np.allclose(
        found.predict(state, RATES, 600.0), wanted.predict(state, RATES, 600.0), atol=1e-12
    )


@pytest.mark.parametrize(
    ('effect', 'parameters', 'wrong'),
    [
        ('leak', {'x': 30.0, 'z': 0.2, 'rate': 5.0}, 'x = 30'),
        ('buoyancy', {'density_difference': 2e3}, 'density_difference = 2000'),
        ('dispersion', {'longitudinal_dispersivity': -1e-3}, 'longitudinal_dispersivity = -0.001'),
        ('retardation', {'retardation_factor': 0.0}, 'retardation_factor = 0'),
        ('magic', {}, 'magic'),
    ],
)
def test_learnt_physics_that_no_rig_can_have_is_refused(
    rig: Rig, grid: Grid, effect: str, parameters: dict[str, float | str], wrong: str
) -> None:
    learnt = LearntPhysics((EffectDescription(name=effect, parameters=parameters),))
    with pytest.raises(InputError, match=wrong):
        LearntModels(rig, grid, 'fast').model(learnt)


def test_a_learnt_scheme_takes_the_place_of_the_own_one(rig: Rig, grid: Grid) -> None:
    solver, state = LearntModels(rig, grid, 'upwind'), np.zeros(grid.shape)
    found = solver.model(LearntPhysics(scheme='fast')).predict(state, RATES, 600.0)
    assert np.array_equal(found, Model(rig, grid, preset='fast').predict(state, RATES, 600.0))
    with pytest.raises(InputError, match="preset 'vague'"):
        solver.model(LearntPhysics(scheme='vague'))


@pytest.mark.parametrize('preset', ['upwind', 'fast'])
def test_the_adjoint_of_a_step_is_the_slope_of_the_prediction(
    rig: Rig, grid: Grid, plume: FloatArray, preset: str
) -> None:
    model = LearntModels(rig, grid, preset).model(EVERYTHING)
    random = np.random.default_rng(3)
    bar, direction = random.normal(size=(2, *grid.shape))
    direction *= plume * (1.0 - plume)
    by_previous = model.step_adjoint(plume, RATES, 90.0, bar)
    step = 1e-6
    up, down = (model.predict(plume + sign * step * direction, RATES, 90.0) for sign in (1, -1))
    slope = float(np.vdot(bar, up - down)) / (2.0 * step)
    assert float(np.vdot(by_previous, direction)) == pytest.approx(slope, rel=1e-4)
