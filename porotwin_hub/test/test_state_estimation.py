"""The state that predictions start from, with a filter and without one."""

import math

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.state_filter import StateFilter
from porotwin_hub.loop.cycle import Cycle, Observation
from porotwin_hub.loop.state_estimation import StateEstimation
from porotwin_hub.models.forecast import Forecast

SHAPE = (6, 8)
TRUTH = np.tile(np.linspace(1.0, 0.2, SHAPE[1]), (SHAPE[0], 1))


def cycle_of(time: float, concentration: FloatArray, expected: FloatArray | None = None) -> Cycle:
    """Return a cycle that begins, with the forecast `expected` of its photograph."""
    observation = Observation(time, concentration, np.full(SHAPE, 0.05), np.zeros(SHAPE))
    cycle = Cycle(observation, concentration, (), {})
    if expected is not None:
        cycle.elapsed = Forecast(0.0, time, {}, expected, expected, '', is_corrected=False)
    return cycle


def estimation() -> StateEstimation:
    return StateEstimation(StateFilter(np.full(SHAPE, 1e-6), (0.01, 0.01)), None)


def test_the_filter_takes_less_noise_than_the_photograph_and_tells_the_expected_error() -> None:
    found, noise = estimation(), np.random.default_rng(4).normal(0.0, 0.05, (2, *SHAPE))
    first = cycle_of(0.0, TRUTH + noise[0])
    found.estimate_state(first)
    assert math.isnan(first.expected_error)
    second = cycle_of(30.0, TRUTH + noise[1], expected=TRUTH)
    found.estimate_state(second)
    assert np.std(second.state - TRUTH) < 0.9 * np.std(noise[1])
    assert 0.03 < second.expected_error < 0.3


def test_without_a_filter_unseen_cells_take_the_forecast_and_no_error_is_expected() -> None:
    found = StateEstimation(None, None)
    seen = TRUTH.copy()
    seen[2, 3] = np.nan
    cycle = cycle_of(30.0, seen, expected=0.5 * TRUTH)
    found.estimate_state(cycle)
    assert cycle.state[2, 3] == 0.5 * TRUTH[2, 3]
    assert math.isnan(cycle.expected_error)
