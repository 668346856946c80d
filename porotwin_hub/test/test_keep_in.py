"""Tests of the objective `keep_in`: tracer outside a zone costs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from porotwin_core.basis.units import to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig, parse_rig
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction
from porotwin_hub.objectives.objective_registry import make_objective


def rig_with(unit_rig: dict[str, Any], zone: FloatArray, fuzziness: float) -> Rig:
    objective = {'name': 'keep_in', 'zone_m': zone.tolist(), 'fuzziness_m': fuzziness}
    control = {'wells': ['a'], 'objective': objective}
    return parse_rig({**unit_rig, 'control': control}, Path('rig.yaml'))


def test_a_full_rig_costs_the_pore_volume_outside_the_zone(
    unit_rig: dict[str, Any], square: FloatArray
) -> None:
    rig = rig_with(unit_rig, square, 0.0)
    grid = rig.grid(50, 50)
    objective = make_objective(rig, grid)
    outside = (1.0 - 0.16) * 0.01 * 0.4
    assert objective(np.ones(grid.shape)) == pytest.approx(outside)
    assert objective.disallowed_tracer(np.ones(grid.shape)) == pytest.approx(outside)
    assert objective(np.full(grid.shape, np.nan)) == 0.0


def test_tracer_near_the_edge_costs_before_it_leaves_the_zone(
    unit_rig: dict[str, Any], square: FloatArray
) -> None:
    rig = rig_with(unit_rig, square, 0.1)
    grid = rig.grid(50, 50)
    objective = make_objective(rig, grid)
    centre, edge = np.zeros(grid.shape), np.zeros(grid.shape)
    centre[20, 20] = 1.0
    edge[20, 28] = 1.0  # 0.03 m inside the edge
    assert objective(centre) == 0.0
    assert objective(edge) > 0.0
    assert objective.disallowed_tracer(edge) == 0.0


class Wind:
    """A model that moves the plume by one cell to the right for every 100 ml/h of the well `a`."""

    def predict(self, concentration: FloatArray, rates: Any, time_step: float) -> FloatArray:
        return np.roll(concentration, int(to_ml_h(rates['a'].rate) // 100.0), axis=1)

    def correct(self, previous: FloatArray, sigma: FloatArray, rates: Any, step: float) -> Any:
        return self.predict(previous, rates, step)


def test_the_controller_moves_a_plume_into_the_zone(unit_rig: dict[str, Any]) -> None:
    zone = np.array([[0.6, 0.0], [1.0, 0.0], [1.0, 1.0], [0.6, 1.0]])
    rig = rig_with(unit_rig, zone, 0.0)
    grid = rig.grid(10, 10)
    controller = Controller(Limits.of(rig), make_objective(rig, grid), horizon=60.0, evaluations=30)
    twin = Twin(Wind(), no_correction, photo_interval=30.0, controller=controller)
    plume = np.zeros(grid.shape)
    plume[5, 3] = 1.0  # three cells to the left of the zone
    setpoint = twin.decide(Observation(0.0, plume)).setpoint
    assert setpoint is not None
    assert to_ml_h(setpoint.rates['a'].rate) >= 300.0
    assert setpoint.reason == 'least tracer outside the zone'
