"""Tests of rollouts: the states under a plan of rates."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_solver.model.model import Model
from porotwin_solver.model.rollout import rollout
from porotwin_solver.model.supervision import Supervision

PUSH = {'injector': WellRate(from_ml_h(400.0), 1.0), 'producer': WellRate(from_ml_h(-400.0))}


def test_a_rollout_is_a_chain_of_predictions(rig) -> None:
    model = Model(rig, rig.grid(31, 19), preset='fast')
    plan = [RateStep(0.0, PUSH), RateStep(120.0, {})]
    early, late = rollout(model, model.initial_condition(), plan, (60.0, 180.0))
    expected = model.predict(model.initial_condition(), PUSH, 60.0)
    np.testing.assert_allclose(early, expected, atol=1e-14)
    expected = model.predict(model.predict(expected, PUSH, 60.0), {}, 60.0)
    np.testing.assert_allclose(late, expected, atol=1e-14)


@pytest.mark.parametrize('times', [(), (0.0,), (10.0, 10.0), (float('nan'),)])
def test_times_that_do_not_increase_are_refused(rig, times) -> None:
    model = Model(rig, rig.grid(31, 19), preset='fast')
    with pytest.raises(InputError, match='times: give at least one'):
        rollout(model, model.initial_condition(), [RateStep(0.0, PUSH)], times)


def test_the_cost_of_the_whole_run_is_judged_before_it_begins(rig) -> None:
    bounds = Supervision(most_cell_updates=1e6)
    model = Model(rig, rig.grid(31, 19), preset='fast', supervision=bounds)
    start = model.initial_condition()
    list(rollout(model, start, [RateStep(0.0, PUSH)], (60.0,)))
    times = [60.0 * (number + 1) for number in range(1440)]
    with pytest.raises(InputError, match=r'over 86400 s: .* cell updates'):
        rollout(model, start, [RateStep(0.0, PUSH)], times)
    flood = {'injector': WellRate(1.0, 1.0), 'producer': WellRate(-1.0)}
    with pytest.raises(InputError, match='cell updates'):
        rollout(model, start, [RateStep(0.0, PUSH), RateStep(60.0, flood)], (30.0, 90.0))
