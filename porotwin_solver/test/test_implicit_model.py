"""The implicit form of the paper: sigma is transported within the step."""

import numpy as np
import pytest
from solver_cases import two_well_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import EffectDescription
from porotwin_solver.adjoint.learnt_coefficients import LearntModels
from porotwin_solver.model.implicit_model import ImplicitModel

RATES = {'injector': WellRate(from_ml_h(500.0), 1.0), 'producer': WellRate(-from_ml_h(300.0))}
STEP_S = 30.0


@pytest.fixture(scope='module')
def model() -> ImplicitModel:
    rig = two_well_rig()
    made = LearntModels(rig, rig.grid(25, 15), 'implicit').model(LearntPhysics())
    assert isinstance(made, ImplicitModel)
    return made


@pytest.fixture(scope='module')
def plume(model: ImplicitModel) -> FloatArray:
    state = model.initial_condition()
    for _ in range(20):
        state = model.predict(state, RATES, STEP_S)
    return state


def test_tracer_is_conserved_and_bounded(model: ImplicitModel, plume: FloatArray) -> None:
    injected = 20 * STEP_S * RATES['injector'].rate
    # the producer has taken a little
    assert np.vdot(model.engine.storage, plume) == pytest.approx(injected, rel=1e-3)
    assert plume.min() >= 0.0
    assert plume.max() <= 1.0 + 1e-12


def test_the_exact_residual_leads_to_the_observed_map(
    model: ImplicitModel, plume: FloatArray
) -> None:
    observed = np.roll(plume, 1, axis=1)
    residual = model.residual(plume, observed, RATES, STEP_S)
    assert np.allclose(model.correct(plume, residual, RATES, STEP_S), observed, atol=1e-12)
    exact = model.residual(plume, model.predict(plume, RATES, STEP_S), RATES, STEP_S)
    assert np.abs(exact).max() < 1e-12


def test_a_source_is_carried_along_within_the_step(model: ImplicitModel, plume: FloatArray) -> None:
    sigma = np.zeros(model.grid.shape)
    sigma[6, 9] = 1e-4
    change = model.correct(plume, sigma, RATES, STEP_S) - model.predict(plume, RATES, STEP_S)
    assert np.count_nonzero(change > 1e-9) > 1


def test_the_adjoint_is_the_transposed_step(model: ImplicitModel, plume: FloatArray) -> None:
    random = np.random.default_rng(1)
    bar, direction = random.normal(size=(2, *model.grid.shape))
    moved = model.predict(plume + direction, RATES, STEP_S) - model.predict(plume, RATES, STEP_S)
    by_previous = model.step_adjoint(plume, RATES, STEP_S, bar)
    assert np.vdot(bar, moved) == pytest.approx(np.vdot(by_previous, direction), rel=1e-9)


def test_physics_outside_the_papers_equations_is_refused(model: ImplicitModel) -> None:
    denser = LearntModels(model.rig, model.grid, 'implicit').model(
        LearntPhysics((EffectDescription(name='buoyancy', parameters={'density_difference': 1.0}),))
    )
    with pytest.raises(InputError, match="preset 'implicit': knows the paper's equations only"):
        denser.predict(denser.initial_condition(), RATES, STEP_S)
