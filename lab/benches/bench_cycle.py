"""Speed of one cycle of the hub with the real models."""

import time
from typing import Any

import numpy as np

from porotwin_cli.workspace import small_rig
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.rig import load_rig
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_solver.model.model import Model

HORIZON_S = 1800.0
EVALUATIONS = 60
"""Defaults of the hub for one optimisation: horizon [s] and number of predictions."""

FIRST_STATE_S = 1800.0
"""Age of the plume in the first cycle [s]."""

CYCLES = 15
GRIDS = ((94, 56), (187, 112), (374, 225))
"""Columns and rows: cells of 10, 5 and 2.5 mm."""


def run() -> list[dict[str, Any]]:
    """Return a row per grid: median and longest cycle [s], and the photo interval per cycle.

    A cycle optimises the control rates `HORIZON_S` ahead with at most `EVALUATIONS` predictions,
    and forecasts the next photograph. The states come from the model, so the plume grows as in an
    experiment. Messages and imaging are not included (`bench imaging`, figures of the demo).
    """
    return [_row(nx, nz) for nx, nz in GRIDS]


def _row(nx: int, nz: int) -> dict[str, Any]:
    rig = load_rig(small_rig())
    grid = rig.grid(nx, nz)
    model = Model(rig, grid, preset='fast')
    twin = Twin(
        model,
        no_correction,
        photo_interval=USUAL_PHOTO_INTERVAL_S,
        controller=Controller(
            Limits.of(rig), make_objective(rig, grid), horizon=HORIZON_S, evaluations=EVALUATIONS
        ),
    )
    state = model.predict(model.initial_condition(), Limits.of(rig).safe(), FIRST_STATE_S)
    seconds = []
    evaluations = []
    for number in range(CYCLES):
        begun = time.perf_counter()
        cycle = twin.cycle(Observation(number * USUAL_PHOTO_INTERVAL_S, state))
        seconds.append(time.perf_counter() - begun)
        assert cycle.forecast is not None
        assert cycle.decision is not None
        evaluations.append(cycle.decision.evaluations)
        state = cycle.forecast.predicted
    median = float(np.median(seconds))
    return {
        'grid': f'{nx}x{nz}',
        'cycle, median [s]': round(median, 3),
        'longest [s]': round(max(seconds), 3),
        'predictions': round(float(np.mean(evaluations)), 1),
        'times faster than photographs': round(USUAL_PHOTO_INTERVAL_S / median, 1),
    }
