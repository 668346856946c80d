"""Least squares within bounds, on functions with known minima."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model import levenberg_marquardt
from porotwin_core.model.levenberg_marquardt import Bounds, minimise

WIDE = Bounds(np.array([-50.0]), np.array([50.0]))


def slopes_of(residuals_at):
    """Return minus the derivative of `residuals_at` by one-sided differences."""

    def slopes_at(parameters, residuals):
        columns = []
        for index in range(len(parameters)):
            moved = parameters.copy()
            moved[index] += 1e-6
            columns.append((residuals[0] - residuals_at(moved)[0]) / 1e-6)
        return [np.stack(columns)]

    return slopes_at


def minimum(residuals_at, start, bounds=WIDE, **options):
    options = {'iterations': 8} | options
    start = np.array(start, dtype=float)
    return minimise(residuals_at, slopes_of(residuals_at), start, bounds, **options)


def arctangent(parameters):
    """Return a residual whose slope vanishes far from its root at zero."""
    return [np.arctan(parameters)]


def refusing(parameters):
    """Return the same residual, but refuse values below minus one."""
    if parameters[0] < -1.0:
        raise InputError('value: must be at least -1')
    return arctangent(parameters)


def linear(parameters):
    """Return residuals of a linear model with the optimum (2, -3)."""
    matrix = np.array([[1.0, 0.5], [0.0, 1.0], [2.0, -1.0]])
    return [matrix @ (parameters - np.array([2.0, -3.0]))]


def test_a_linear_problem_is_solved():
    bounds = Bounds(np.full(2, -20.0), np.full(2, 20.0))
    assert minimum(linear, [10.0, 10.0], bounds) == pytest.approx([2.0, -3.0], abs=1e-3)


def test_a_parameter_stays_at_its_bound_while_the_others_move():
    bounds = Bounds(np.array([-20.0, -1.0]), np.array([20.0, 20.0]))
    found = minimum(linear, [10.0, 10.0], bounds)
    assert found[1] == -1.0
    columns = np.array([1.0, 0.0, 2.0]), np.array([0.5, 1.0, -1.0])
    best = 2.0 - (columns[0] @ columns[1]) * 2.0 / (columns[0] @ columns[0])
    assert found[0] == pytest.approx(best, abs=1e-3)


def test_a_start_with_a_vanishing_slope_takes_shorter_steps_until_one_helps():
    assert abs(minimum(arctangent, [10.0])[0]) < 0.5


def test_a_step_to_where_the_model_cannot_run_is_not_taken():
    assert abs(minimum(refusing, [10.0])[0]) < 0.5


def test_a_start_where_the_model_cannot_run_is_returned():
    assert minimum(refusing, [-3.0]) == [-3.0]


def test_with_one_trial_a_rejected_step_ends_the_iteration():
    assert minimum(arctangent, [10.0], trials=1) == [10.0]


def test_the_iteration_ends_where_it_gains_too_little(monkeypatch):
    once = minimum(arctangent, [0.9], iterations=1)
    assert abs(minimum(arctangent, [0.9])) < 1e-3 * abs(once)
    monkeypatch.setattr(levenberg_marquardt, 'LEAST_GAIN', 1.0)
    assert minimum(arctangent, [0.9]) == once


def curved(parameters):
    """Return residuals of a curved model with the optimum (0, 0)."""
    first, second = parameters
    return [np.array([np.expm1(first) + 0.3 * second, second + 0.2 * first**2])]


def test_updated_slopes_converge_faster_than_those_of_the_start():
    bounds = Bounds(np.full(2, -20.0), np.full(2, 20.0))
    start = np.array([1.5, 0.5])
    first = slopes_of(curved)(start, curved(start))
    left = [
        minimise(curved, lambda *_: first, start, bounds, iterations=5, updated_slopes=updated)
        for updated in (False, True)
    ]
    assert np.abs(left[1]).max() < 0.05
    assert np.abs(left[1]).max() < 0.5 * np.abs(left[0]).max()
