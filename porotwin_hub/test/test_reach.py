"""Tests of the objective `reach`: only the state at one time costs."""

from typing import Any

import numpy as np
import pytest
from hub_examples import made

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray


def test_the_cost_is_taken_at_its_time(unit_rig: dict[str, Any], square: FloatArray) -> None:
    _, objective = made(unit_rig, name='reach', zone_m=square.tolist(), at_min=30)
    (term,) = objective.terms(600.0, 3600.0)
    assert (term.start, term.end) == (1200.0, 1200.0)
    (late,) = objective.terms(0.0, 900.0)  # the time lies beyond the plan: its end comes nearest
    assert late.start == late.end == 900.0
    assert objective.terms(1801.0, 600.0) == ()
    assert objective.goal == 'tracer at its place after 30 min'
    assert objective(np.ones((50, 50))) == 0.0
    assert objective(np.zeros((50, 50))) > 0.0


def test_a_time_before_the_start_is_refused(unit_rig: dict[str, Any], square: FloatArray) -> None:
    with pytest.raises(InputError, match='at_min'):
        made(unit_rig, name='reach', zone_m=square.tolist(), at_min=-1)
