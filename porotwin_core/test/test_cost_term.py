"""Tests of cost terms: value, derivative, other grids."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.cost_term import CostTerm

RANDOM = np.random.default_rng(5)
LINEAR, QUADRATIC, TARGET, MAP = RANDOM.random((4, 6, 8))
TERM = CostTerm(0.0, 60.0, linear=LINEAR, quadratic=QUADRATIC, target=TARGET)


def test_the_value_is_linear_and_quadratic_in_the_concentration() -> None:
    expected = (LINEAR * MAP + QUADRATIC * (MAP - TARGET) ** 2).sum()
    assert TERM.value(MAP) == pytest.approx(expected)
    assert CostTerm(0.0, 1.0).value(MAP) == 0.0


def test_the_derivative_equals_differences() -> None:
    direction = RANDOM.standard_normal(MAP.shape)
    step = 1e-6
    rise = TERM.value(MAP + step * direction) - TERM.value(MAP - step * direction)
    assert np.vdot(TERM.derivative(MAP), direction) == pytest.approx(rise / (2.0 * step))


def test_a_term_on_another_grid_costs_the_same_for_a_uniform_map() -> None:
    weights = CostTerm(0.0, 60.0, linear=LINEAR, quadratic=QUADRATIC)
    coarse = weights.on_cells((3, 4))
    assert coarse.value(np.full((3, 4), 0.7)) == pytest.approx(weights.value(np.full((6, 8), 0.7)))
    assert (coarse.start, coarse.end, coarse.target) == (0.0, 60.0, None)


@pytest.mark.parametrize('times', [(-1.0, 5.0), (5.0, 4.0), (0.0, 61.0), (float('nan'), 5.0)])
def test_times_outside_the_horizon_are_refused(times: tuple[float, float]) -> None:
    with pytest.raises(InputError, match='must lie within 0 to 60 s'):
        CostTerm(*times).check(MAP.shape, 60.0)
