"""Tests of COBYLA: it finds the minimum of a parabola, inside the limits and at their edge."""

import numpy as np
import pytest
from hub_examples import LIMITS, quadratic

from porotwin_core.basis.units import to_ml_h
from porotwin_hub.control import cobyla
from porotwin_hub.control.optimisation import optimise


@pytest.mark.parametrize('best', [(120.0, 40.0, 210.0), (0.0, 0.0, 0.0), (0.0, 480.0, 0.0)])
def test_cobyla_finds_the_minimum_of_a_parabola(best: tuple[float, float, float]) -> None:
    decision = optimise(
        LIMITS, quadratic(best), LIMITS.safe(), evaluations=120, search=cobyla.search
    )
    found = to_ml_h(1.0) * LIMITS.control_rates(decision.rates)
    np.testing.assert_allclose(found, best, atol=6.0)
    assert decision.evaluations <= 120


def test_cobyla_ends_at_the_total_limit() -> None:
    decision = optimise(
        LIMITS, quadratic((400.0, 400.0, 0.0)), LIMITS.safe(), evaluations=150, search=cobyla.search
    )
    found = to_ml_h(1.0) * LIMITS.control_rates(decision.rates)
    np.testing.assert_allclose(found, (250.0, 250.0, 0.0), atol=10.0)
