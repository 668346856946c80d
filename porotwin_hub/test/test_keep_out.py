"""Tests of the objective `keep_out`: tracer in a zone costs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig, parse_rig
from porotwin_hub.objectives.objective_registry import make_objective


@pytest.fixture
def rig(unit_rig: dict[str, Any], square: FloatArray) -> Rig:
    control = {'wells': ['a'], 'disallowed_zone_m': square.tolist(), 'fuzziness_m': 0.0}
    return parse_rig({**unit_rig, 'control': control}, Path('rig.yaml'))


def test_the_cost_of_a_full_zone_is_its_pore_volume(rig: Rig) -> None:
    grid = rig.grid(50, 50)
    objective = make_objective(rig, grid)
    assert objective(np.ones(grid.shape)) == pytest.approx(0.16 * 0.01 * 0.4)
    assert objective(np.full(grid.shape, np.nan)) == 0.0


def test_tracer_near_the_zone_costs_before_it_is_disallowed(
    unit_rig: dict[str, Any], square: FloatArray
) -> None:
    control = {'wells': ['a'], 'disallowed_zone_m': square.tolist(), 'fuzziness_m': 0.2}
    rig = parse_rig({**unit_rig, 'control': control}, Path('rig.yaml'))
    grid = rig.grid(50, 50)
    objective = make_objective(rig, grid)
    plume = np.zeros(grid.shape)
    plume[20, 35] = 1.0  # 0.11 m beside the zone
    assert objective(plume) > 0.0
    assert objective.disallowed_tracer(plume) == 0.0
    assert objective.disallowed_tracer(np.ones(grid.shape)) == pytest.approx(0.16 * 0.01 * 0.4)


def test_the_goal_is_the_reason_of_a_setpoint(rig: Rig) -> None:
    goal = make_objective(rig, rig.grid(5, 5)).goal
    assert goal == 'least tracer in the disallowed zone'
