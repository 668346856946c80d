"""Models with learnt physics: the same as with the effects that do the same; exact adjoint."""

import numpy as np
import pytest
from solver_cases import two_well_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntLeak, LearntPhysics, SandPatch
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.adjoint.learnt_coefficients import LearntModels
from porotwin_solver.model.model import Model

RATES = {
    'injector': WellRate(from_ml_h(500.0), 1.0),
    'producer': WellRate(-from_ml_h(400.0)),
}
EVERYTHING = LearntPhysics(
    density_difference=1.0,
    longitudinal_dispersivity=1e-3,
    transverse_dispersivity=1e-4,
    background_flux=(2e-7, -1e-7),
    log_retardation=0.1,
    leaks=(LearntLeak(0.3, 0.2, from_ml_h(20.0)),),
    patches=(SandPatch(0.2, 0.2, 0.06, -1.0),),
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
    ('learnt', 'effect', 'parameters'),
    [
        (LearntPhysics(density_difference=1.5), 'buoyancy', {'density_difference': 1.5}),
        (LearntPhysics(log_retardation=np.log(1.2)), 'retardation', {'retardation_factor': 1.2}),
        (
            LearntPhysics(background_flux=(2e-7, 1e-7)),
            'background_flow',
            {'x_velocity': 2e-7, 'z_velocity': 1e-7},
        ),
        (
            LearntPhysics(leaks=(LearntLeak(0.3, 0.2, from_ml_h(30.0)),)),
            'leak',
            {'x': 0.3, 'z': 0.2, 'rate': 30.0},
        ),
    ],
)
def test_learnt_physics_does_what_the_effect_does(
    rig: Rig, grid: Grid, learnt: LearntPhysics, effect: str, parameters: dict[str, float | str]
) -> None:
    named = EffectDescription(name=effect, parameters=parameters)
    wanted = Model(rig, grid, preset='fast', effects=[named])
    found = LearntModels(rig, grid, 'fast').model(learnt)
    state = np.zeros(grid.shape)
    assert np.allclose(
        found.predict(state, RATES, 600.0), wanted.predict(state, RATES, 600.0), atol=1e-12
    )


def test_a_patch_outside_the_rig_is_refused(rig: Rig, grid: Grid) -> None:
    far = LearntPhysics(patches=(SandPatch(30.0, 0.2, 0.1, 1.0),))
    with pytest.raises(InputError, match=r'patch 1 at \(30, 0.2\) m lies outside the rig'):
        LearntModels(rig, grid, 'fast').model(far)


def test_a_learnt_scheme_takes_the_place_of_the_own_one(rig: Rig, grid: Grid) -> None:
    solver, state = LearntModels(rig, grid, 'upwind'), np.zeros(grid.shape)
    found = solver.model(LearntPhysics(scheme='fast')).predict(state, RATES, 600.0)
    assert np.array_equal(found, Model(rig, grid, preset='fast').predict(state, RATES, 600.0))
    with pytest.raises(InputError, match="preset 'vague'"):
        solver.model(LearntPhysics(scheme='vague'))


def test_a_run_is_the_steps_one_after_the_other(rig: Rig, grid: Grid) -> None:
    solver = LearntModels(rig, grid, 'fast')
    rates = {name: WellRate(0.2 * well.rate, well.concentration) for name, well in RATES.items()}
    schedule, start = Schedule.constant(rates), np.zeros(grid.shape)
    maps = solver.run(EVERYTHING, schedule, np.array([60.0, 120.0]), initial=start, start=0.0)
    model = solver.model(EVERYTHING)
    first = model.predict(start, rates, 60.0)
    assert np.allclose(maps[0], first)
    assert np.allclose(maps[1], model.predict(first, rates, 60.0))


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
