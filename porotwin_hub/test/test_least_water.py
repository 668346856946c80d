"""Tests of the objective `least_water`, alone and as a part of a sum."""

from typing import Any

import numpy as np
import pytest
from hub_examples import made

from porotwin_core.geometry.grid import FloatArray
from porotwin_hub.objectives.objective import WeightedSum


def test_only_water_costs(unit_rig: dict[str, Any]) -> None:
    _, objective = made(unit_rig, name='least_water', ml_min_per_ml=0.5)
    assert objective.water_cost == pytest.approx(30.0)
    assert objective(np.ones((50, 50))) == objective.disallowed_tracer(np.ones((50, 50))) == 0.0
    assert objective.terms(0.0, 600.0) == ()


def test_a_sum_weighs_its_parts(unit_rig: dict[str, Any], square: FloatArray) -> None:
    zone = square.tolist()
    parts = [
        {'name': 'keep_in', 'weight': 2.0, 'zone_m': zone},
        {'name': 'least_water', 'weight': 3.0},
    ]
    _, both = made(unit_rig, name='sum', parts=parts)
    _, alone = made(unit_rig, name='keep_in', zone_m=zone)
    full = np.ones((50, 50))
    assert both(full) == pytest.approx(2.0 * alone(full))
    assert both.water_cost == pytest.approx(3.0 * 0.6)
    assert both.disallowed_tracer(full) == alone.disallowed_tracer(full)
    (term,), (part,) = both.terms(0.0, 60.0), alone.terms(0.0, 60.0)
    assert term.value(full) == pytest.approx(2.0 * part.value(full))
    assert both.goal == 'least tracer outside the zone, little water'
    assert WeightedSum(((1.0, both), (1.0, both))).goal == both.goal
