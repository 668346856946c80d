"""Control with other objectives: one of the project, and one that is defined here.

`keep_in` keeps the tracer in a zone. `gather` pulls the tracer towards a point: with the distance d
to the point and the width W of the rig its cost is

    f(c) = integral of c (d / W)^2 porosity depth dx   [m^3].

The controller chooses new rates every ten minutes by predictions of the solver.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import draw_map, picture_path

from porotwin_core.basis.units import to_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import ObjectiveDescription, Rig, load_rig
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.objectives.objective import Objective, WeightedTracer, pore_volume
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_solver.model.model import Model

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'
ZONE = [[0.08, 0.0], [0.80, 0.0], [0.80, 0.36], [0.08, 0.36]]
TARGET = (0.30, 0.05)


def gather(rig: Rig, grid: Grid, target: tuple[float, float]) -> WeightedTracer:
    """Return the objective that pulls the tracer towards `target` (x, z) [m]."""
    distance = np.hypot(grid.x - target[0], grid.z[:, None] - target[1])
    pores = pore_volume(rig, grid)
    return WeightedTracer(
        goal='tracer near the target',
        weights=(distance / rig.width_m) ** 2 * pores,
        disallowed=np.where(distance > 0.2, pores, 0.0),
    )


rig = load_rig(SMALL_RIG)
grid = rig.grid(94, 56)
model = Model(rig, grid, preset='fast')
limits = Limits.of(rig)
assert rig.control is not None
description = ObjectiveDescription(name='keep_in', parameters={'zone_m': ZONE})
control = rig.control.model_copy(update={'objective': description})
keep_in = make_objective(rig.model_copy(update={'control': control}), grid)
towards_target = gather(rig, grid, TARGET)


def controlled(objective: Objective) -> tuple[FloatArray, WellRates]:
    """Return the map after one hour of control, and the rates chosen last."""
    controller = Controller(limits, objective, horizon=1200.0, evaluations=30)
    state, rates = model.initial_condition(), limits.safe()
    for _ in range(6):
        rates = controller.decide(model, state, rates).rates
        state = model.predict(state, rates, 600.0)
    return state, rates


free = model.predict(model.initial_condition(), limits.safe(), 3600.0)
runs = {'keep_in': (keep_in, *controlled(keep_in))}
runs['gather'] = (towards_target, *controlled(towards_target))

figure, axes = plt.subplots(1, 3, figsize=(11, 2.8), layout='constrained', sharey=True)
draw_map(axes[0], rig, free, title='no control\n')
for axis, (name, (objective, state, rates)) in zip(axes[1:], runs.items(), strict=True):
    chosen = ', '.join(f'{to_ml_h(rates[well].rate):.0f}' for well in limits.wells)
    cost, cost_free = 1e6 * objective(state), 1e6 * objective(free)
    print(f'{name}: cost {cost:.1f} ml, {cost_free:.1f} ml without control; last {chosen} ml/h')
    assert cost < 0.9 * cost_free
    image = draw_map(axis, rig, state, title=f'{name}\ncontrol1 to 3: {chosen} ml/h')
for axis in axes[1:]:
    axis.label_outer()
axes[1].plot(*np.array([*ZONE, ZONE[0]]).T, '--', color='tab:orange')
axes[2].plot(*TARGET, '+', color='tab:orange', markersize=12)
figure.colorbar(image, ax=axes, shrink=0.8, label='concentration [-]')
figure.savefig(picture_path(__file__), dpi=90)
