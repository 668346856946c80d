"""Examples for the tests of the hub: a toy rig, a model of one line, limits, a parabola."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig, parse_rig
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.models.forecast import ModelUnavailable
from porotwin_hub.objectives.objective import Objective
from porotwin_hub.objectives.objective_registry import make_objective

SMALL_RIG = Path(__file__).resolve().parents[1] / 'config' / 'small_rig.yaml'

TOY: dict[str, Any] = {
    'name': 'toy',
    'width_m': 1.0,
    'height_m': 0.5,
    'depth_m': 0.01,
    'porosity': 0.4,
    'permeability_m2': 1e-9,
    'viscosity_pa_s': 1e-3,
    'density_kg_m3': 998.0,
    'wells': {
        name: {'x_m': x, 'z_m': 0.2}
        for name, x in [('injector', 0.2), ('push', 0.5), ('producer', 0.8)]
    },
    'control': {
        'wells': ['push'],
        'producer': 'producer',
        'fixed': {'injector': {'rate_ml_h': 500.0, 'concentration': 1.0}},
        'disallowed_zone_m': [[0, 0.4], [1, 0.4], [1, 0.5], [0, 0.5]],
        'fuzziness_m': 0.0,
    },
}


class ToyModel:
    """Tracer grows everywhere, least at a push of 300 ml/h; sigma adds to it.

    dc/dt = 1e-4 (1 + (push - 300)^2 / 3e5) + sigma, with the push in ml/h.
    """

    def __init__(self) -> None:
        self.available = True
        self.steps: list[float] = []
        """The time steps [s] of all predictions so far."""

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        self.steps.append(time_step)
        if not self.available:
            raise ModelUnavailable('the solver does not answer; start it')
        push = to_ml_h(rates.get('push', WellRate()).rate)
        return concentration + time_step * 1e-4 * (1.0 + (push - 300.0) ** 2 / 3e5)

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return self.predict(previous, rates, time_step) + time_step * sigma


LIMITS = Limits(
    wells=('control1', 'control2', 'control3'),
    producer='producer',
    fixed={'injector': WellRate(from_ml_h(500.0), 1.0)},
    max_rate=from_ml_h(500.0),
    max_total_rate=from_ml_h(500.0),
    all_wells=('injector', 'producer', 'control1', 'control2', 'control3', 'idle'),
)


def quadratic(best_ml_h: tuple[float, float, float]) -> Callable[[WellRates], float]:
    """Return a cost of the rates in `LIMITS`: a parabola with its minimum at `best_ml_h`."""

    def cost(rates: WellRates) -> float:
        values = to_ml_h(1.0) * LIMITS.control_rates(rates)
        return float(((values - np.array(best_ml_h)) ** 2).sum())

    return cost


def made(unit_rig: dict[str, Any], **objective: Any) -> tuple[Rig, Objective]:
    """Return the unit rig with an `objective` of its well a, and that on 50 x 50 cells."""
    control = {'wells': ['a'], 'objective': objective}
    rig = parse_rig({**unit_rig, 'control': control}, Path('rig.yaml'))
    return rig, make_objective(rig, rig.grid(50, 50))
