"""Pictures of a closed-loop run, as in the paper's section 4."""

from pathlib import Path

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap

from porotwin_cli.run_account import ML, RunAccount, TrueTracer
from porotwin_core.grid import FloatArray
from porotwin_core.rig import Rig

SAND_TO_TRACER = LinearSegmentedColormap.from_list('tracer', ['#efe6d8', '#7fae6b', '#12502f'])
DPI = 110
"""Resolution of the pictures [dots per inch]."""

SHOWN_MINUTES = (10, 35, 60, 80)
"""Times of the paper's figures [min]."""


def plume_picture(path: Path, rig: Rig, controlled: TrueTracer, free: TrueTracer) -> None:
    """Draw the true plume with and without control at `SHOWN_MINUTES`, as far as the run went."""
    last = controlled.times[-1] / 60.0
    minutes = [time for time in SHOWN_MINUTES if time <= last] or [last]
    figure, rows = plt.subplots(
        2, len(minutes), figsize=(4.2 * len(minutes), 5.8), squeeze=False, layout='constrained'
    )
    for label, truth, axes in (('with control', controlled, rows[0]), ('without', free, rows[1])):
        for minute, axis in zip(minutes, axes, strict=True):
            _draw_rig(axis, rig, truth.at(minute * 60.0))
            axis.set_title(f'{label}, {minute:.0f} min')
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


def _draw_rig(axis: Axes, rig: Rig, concentration: FloatArray) -> None:
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    axis.imshow(
        concentration, origin='lower', extent=extent, cmap=SAND_TO_TRACER, vmin=0.0, vmax=1.0
    )
    if rig.control is not None:
        zone = np.array([*rig.control.disallowed_zone_m, rig.control.disallowed_zone_m[0]])
        axis.fill(zone[:, 0], zone[:, 1], facecolor='none', edgecolor='#b03a2e', hatch='//', lw=0)
        axis.plot(zone[:, 0], zone[:, 1], color='#b03a2e', lw=1.2)
    for name, well in rig.wells.items():
        axis.plot(well.x_m, well.z_m, 'o', mfc='white', mec='black', ms=5)
        axis.annotate(name, (well.x_m, well.z_m), (3, 4), textcoords='offset points', fontsize=7)
    axis.set_xlim(0.0, rig.width_m)
    axis.set_ylim(0.0, rig.height_m)
    axis.set_xlabel('x [m]')
    axis.set_ylabel('z [m]')


def course_picture(
    path: Path, rig: Rig, account: RunAccount, controlled: TrueTracer, free: TrueTracer
) -> None:
    """Draw setpoints, tracer in the zone, prediction errors and cycle times over a run."""
    figure, axes = plt.subplots(4, 1, figsize=(9, 11), sharex=True, layout='constrained')
    for well, rates in account.rates_ml_h.items():
        axes[0].step(np.array(account.setpoint_times) / 60, rates, where='post', label=well)
    axes[0].set_ylabel('setpoint [ml/h]')
    for label, truth, colour in (
        ('with control', controlled, '#12502f'),
        ('without control', free, '#b03a2e'),
    ):
        axes[1].plot(truth.times / 60, truth.disallowed(rig) * ML, color=colour, label=label)
    axes[1].set_ylabel('tracer in the zone [ml]')
    minutes = np.array(account.times) / 60
    axes[2].semilogy(minutes, account.prediction_error, label='physics-based model')
    if any(account.corrected):
        axes[2].semilogy(minutes, account.corrected_error, label='with COSTA')
    axes[2].set_ylabel('relative error of the\nprediction for this photo')
    axes[3].plot(minutes, account.cycle_s, label='state to setpoint')
    axes[3].set_ylabel('wall-clock time [s]')
    axes[3].set_ylim(bottom=0.0)
    axes[3].set_xlabel('time since the start of the injection [min]')
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, loc='best')
    figure.savefig(path, dpi=DPI)
    plt.close(figure)
