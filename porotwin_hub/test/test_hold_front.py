"""Tests of the objective `hold_front`: tracer beyond the edge costs, as water before it."""

from typing import Any

import numpy as np
from hub_examples import made

from porotwin_core.geometry.grid import FloatArray


def test_the_wanted_front_costs_nothing_and_any_other_one_does(unit_rig: dict[str, Any]) -> None:
    left = [[0, 0], [0.5, 0], [0.5, 1], [0, 1]]
    rig, objective = made(unit_rig, name='hold_front', tracer_m=left, band_m=0.2)
    x = np.broadcast_to(rig.grid(50, 50).x, (50, 50))
    costs = [objective((x < front).astype(float)) for front in (0.4, 0.48, 0.5, 0.52, 0.6)]
    assert costs[2] == 0.0
    assert costs[0] > costs[1] > 0.0
    assert costs[4] > costs[3] > 0.0
    far = (x < 0.5) & (x > 0.2)  # water beyond the band
    assert objective(far.astype(float) + (x <= 0.05)) == objective(far.astype(float) + 0.0)


def test_unseen_cells_count_as_empty(unit_rig: dict[str, Any], square: FloatArray) -> None:
    _, objective = made(unit_rig, name='hold_front', tracer_m=square.tolist())
    unseen = np.full((50, 50), np.nan)
    assert objective(unseen) == objective(np.zeros((50, 50)))
