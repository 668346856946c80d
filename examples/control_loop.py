"""Run the closed loop in one process, without ROS: the virtual rig, and the twin that controls it.

Every two minutes the twin receives a map of the rig. It chooses the rates of three control wells,
so that little tracer reaches the disallowed zone (paper, section 4), and forecasts the next map.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import draw_map, picture_path

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import load_rig
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.model import Model

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'

rig = load_rig(SMALL_RIG)
grid = rig.grid(62, 37)
interval, photographs = 120.0, 31
limits, objective = Limits.of(rig), make_objective(rig, grid)
controller = Controller(limits, objective, horizon=600.0, evaluations=25)
twin = Twin(
    Model(rig, grid, preset='fast'),
    no_correction,
    photo_interval=interval,
    controller=controller,
)


def run(twin: Twin | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return tracer in the zone [ml] and forecast errors [-] over time, and the last map."""
    asset = VirtualRig(rig, cell=0.005)
    in_zone, errors = np.zeros(photographs), np.full(photographs, np.nan)
    for number in range(photographs):
        state = asset.concentration(grid)
        in_zone[number] = 1e6 * objective.disallowed_tracer(state)
        rates = limits.safe()
        if twin is not None:
            cycle = twin.cycle(Observation(asset.time, state))
            errors[number] = cycle.corrected_error
            assert cycle.setpoint is not None
            rates = cycle.setpoint.rates
        if number < photographs - 1:
            asset.set_rates(rates)
            asset.advance(interval)
    return in_zone, errors, state


zone_with, errors, state_with = run(twin)
zone_without, _, state_without = run(None)
print(f'tracer in the zone after {(photographs - 1) * interval / 60:.0f} min: ', end='')
print(f'{zone_with[-1]:.1f} ml with the twin, {zone_without[-1]:.1f} ml without; ', end='')
print(f'forecast error {np.nanmedian(errors):.3f}')
assert zone_with[-1] < 0.5 * zone_without[-1]

figure, axes = plt.subplots(1, 3, figsize=(12, 2.8), layout='constrained')
draw_map(axes[0], rig, state_with, title='with the twin, 60 min')
image = draw_map(axes[1], rig, state_without, title='without control, 60 min')
assert rig.control is not None
zone = np.array(rig.control.disallowed_zone_m)
for axis in axes[:2]:
    axis.fill(*zone.T, fill=False, hatch='//', edgecolor='tab:red')
    axis.set(xlim=(0, rig.width_m), ylim=(0, rig.height_m))
figure.colorbar(image, ax=axes[:2], shrink=0.9, label='concentration [-]')
minutes = np.arange(photographs) * interval / 60
axes[2].plot(minutes, zone_with, label='with the twin')
axes[2].plot(minutes, zone_without, label='without control')
axes[2].set(xlabel='time [min]', ylabel='tracer in the zone [ml]')
axes[2].legend()
figure.savefig(picture_path(__file__), dpi=90)
