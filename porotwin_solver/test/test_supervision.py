"""Tests of the bounds of a prediction: its length, its cost, and the check between its steps."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import EffectDescription
from porotwin_solver.adjoint.schedule_cost import schedule_cost
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.model.model import Model
from porotwin_solver.model.supervision import Supervision


def test_a_prediction_longer_than_allowed_is_refused_at_once(rig, rates) -> None:
    model = Model(rig, rig.grid(31, 19), preset='fast', supervision=Supervision(longest_s=3600.0))
    state = model.initial_condition()
    for ask in (
        lambda: model.predict(state, rates, 1e12),
        lambda: model.residual(state, state, rates, 1e12),
        lambda: model.correct(state, state, rates, 1e12),
    ):
        with pytest.raises(InputError, match=r'over 1e\+12 s: the longest one is 3600 s'):
            ask()


@pytest.mark.parametrize('rate', [1e-3, 1e300])
def test_a_costly_prediction_is_refused_with_its_estimate(rig, rate: float) -> None:
    model = Model(
        rig, rig.grid(31, 19), preset='fast', supervision=Supervision(most_cell_updates=1e6)
    )
    flood = {'injector': WellRate(rate, 1.0), 'producer': WellRate(-rate)}
    with pytest.raises(InputError, match=r'cell updates, about .* minutes'):
        model.predict(model.initial_condition(), flood, 600.0)


def test_the_check_is_called_between_steps_and_changes_no_bit(rig, rates) -> None:
    calls = []
    watched = Model(
        rig,
        rig.grid(31, 19),
        preset='fast',
        supervision=Supervision(check=lambda: calls.append(None)),
    )
    state = np.random.default_rng(1).random((19, 31))
    expected = Model(rig, rig.grid(31, 19), preset='fast').predict(state, rates, 600.0)
    assert watched.predict(state, rates, 600.0).tobytes() == expected.tobytes()
    assert len(calls) == 10


def test_a_check_that_raises_ends_the_prediction_and_the_next_one_is_right(rig, rates) -> None:
    stop = [True]

    def check() -> None:
        if stop:
            raise KeyboardInterrupt

    model = Model(rig, rig.grid(31, 19), preset='fast', supervision=Supervision(check=check))
    state = np.random.default_rng(1).random((19, 31))
    with pytest.raises(KeyboardInterrupt):
        model.predict(state, rates, 600.0)
    stop.clear()
    expected = Model(rig, rig.grid(31, 19), preset='fast').predict(state, rates, 600.0)
    assert model.predict(state, rates, 600.0).tobytes() == expected.tobytes()


def much_denser(physics: Physics) -> Physics:
    """Return `physics` with a tracer so dense that it falls through the rig within a moment."""
    return replace(physics, density_difference=1e6)


def test_a_prediction_that_becomes_costly_after_its_first_step_is_refused(rig, rates) -> None:
    calls: list[None] = []
    bounds = Supervision(most_cell_updates=1e6, check=lambda: calls.append(None))
    grid = rig.grid(31, 19)
    model = Model(rig, grid, preset='fast', supervision=bounds, adapt=much_denser)
    with pytest.raises(InputError, match=r'cell updates, about .* minutes') as refused:
        model.predict(model.initial_condition(), rates, 600.0)
    assert len(calls) == 1  # the empty rig has no density flow: the first step is cheap
    assert '\n' not in str(refused.value)


def test_a_plan_that_becomes_costly_after_its_first_step_is_refused(rig, rates) -> None:
    bounds = Supervision(most_cell_updates=1e6)
    grid = rig.grid(31, 19)
    model = Model(rig, grid, preset='fast', supervision=bounds, adapt=much_denser)
    plan = [RateStep(0.0, rates)]
    terms = [CostTerm(0.0, 600.0, linear=np.ones(grid.shape))]
    with pytest.raises(InputError, match=r'cell updates, about .* minutes'):
        schedule_cost(
            model,
            model.initial_condition(),
            plan,
            horizon=600.0,
            terms=terms,
            with_gradient=False,
        )


def test_the_bounds_change_no_bit_where_the_tracer_changes_the_flow(rig, rates) -> None:
    dense = EffectDescription(name='buoyancy', parameters={'density_difference': 2.0})
    free = Model(rig, rig.grid(31, 19), preset='fast', effects=[dense])
    bounds = Supervision(most_cell_updates=1e8)
    bound = Model(rig, rig.grid(31, 19), preset='fast', effects=[dense], supervision=bounds)
    state = np.random.default_rng(1).random((19, 31))
    expected = free.predict(state, rates, 600.0)
    assert bound.predict(state, rates, 600.0).tobytes() == expected.tobytes()
