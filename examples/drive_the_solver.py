"""Simulate the paper's small rig: inject tracer for 40 minutes, then rinse with water.

The picture shows the plume at four times. The text line compares the tracer in the rig with the
tracer that was injected.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import picture_path

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import load_rig
from porotwin_solver.model.simulation import simulate

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'

rig = load_rig(SMALL_RIG)
grid = rig.grid(187, 112)
minute = 60.0
tracer, water = WellRate(from_ml_h(500.0), 1.0), WellRate(from_ml_h(500.0), 0.0)
schedule = Schedule(
    (
        ScheduleRow(0.0, 'injector', tracer),
        ScheduleRow(40 * minute, 'injector', water),
        ScheduleRow(0.0, 'producer', WellRate(from_ml_h(-500.0))),
    )
)
times = np.array([10, 25, 40, 80]) * minute
maps = simulate(rig, schedule, times, grid=grid, preset='fast')

pore_volume = rig.cell_pore_volume(grid)
in_rig_ml = 1e6 * float((maps[2] * pore_volume).sum())
injected_ml = 500.0 * 40 / 60
print(f'after 40 min: {in_rig_ml:.1f} ml of tracer in the rig, {injected_ml:.1f} ml injected')
assert abs(in_rig_ml - injected_ml) < 0.01 * injected_ml

figure, axes = plt.subplots(1, 4, figsize=(12, 2.4), layout='constrained')
for axis, time, concentration in zip(axes, times, maps, strict=True):
    image = axis.imshow(
        concentration, origin='lower', extent=(0, rig.width_m, 0, rig.height_m), vmin=0, vmax=1
    )
    axis.set(title=f'{time / minute:.0f} min', xlabel='x [m]')
axes[0].set_ylabel('z [m]')
figure.colorbar(image, ax=axes, label='concentration [-]')
figure.savefig(picture_path(__file__), dpi=100)
