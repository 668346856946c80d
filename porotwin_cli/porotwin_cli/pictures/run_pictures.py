"""Pictures of a closed-loop run, as in the paper's section 4."""

from pathlib import Path

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np

from porotwin_cli.pictures.rig_drawing import draw_map, percent_scale
from porotwin_cli.recorded.run_account import RunAccount, TrueTracer
from porotwin_core.basis.errors import writing
from porotwin_core.basis.units import ML
from porotwin_core.rig import Rig
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH
from porotwin_core.rig.well_colours import well_colours

DASHES = ('-', (0, (5, 3)), (0, (2, 2)), (2, (5, 5)), (3, (1, 3)))
"""Line styles of the wells."""

BELOW, ABOVE = 4.0, 1.4
"""Widths of two lines that may have the same values: both must be seen."""

PAPER_MINUTES = (10, 35, 60, 80)
"""Times of the paper's figures [min]."""


def shown_minutes(first: float, last: float) -> list[float]:
    """Return four times [min]: those of the paper's figures for a run of its length, else even.

    Nothing is to be seen at the start of an injection, so that a run from 0 begins at a quarter.
    """
    if first <= PAPER_MINUTES[0] and round(last) == PAPER_MINUTES[-1]:
        return [float(minute) for minute in PAPER_MINUTES]
    return [float(minute) for minute in np.linspace(first or last / 4, last, 4)]


def plume_picture(path: Path, rig: Rig, controlled: TrueTracer, free: TrueTracer) -> None:
    """Draw the true plume with and without control, at four times of the run."""
    minutes = shown_minutes(controlled.times[0] / 60.0, controlled.times[-1] / 60.0)
    figure, rows = plt.subplots(
        2, len(minutes), figsize=(4.2 * len(minutes), 5.8), squeeze=False, layout='constrained'
    )
    for label, truth, axes in (('with control', controlled, rows[0]), ('without', free, rows[1])):
        for minute, axis in zip(minutes, axes, strict=True):
            draw_map(axis, rig, truth.at(minute * 60.0))
            axis.set_title(f'{label}, {minute:.0f} min')
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    plt.close(figure)


def course_picture(
    path: Path, rig: Rig, account: RunAccount, controlled: TrueTracer, free: TrueTracer
) -> None:
    """Draw setpoints, tracer in the zone, prediction errors and cycle times over a run."""
    figure, axes = plt.subplots(4, 1, figsize=(10, 11), sharex=True, layout='constrained')
    colours = well_colours(rig)
    for number, (well, rates) in enumerate(account.rates_ml_h.items()):
        style = DASHES[number % len(DASHES)]  # equal rates of two wells must both be seen
        minutes = np.array(account.setpoint_times) / 60
        axes[0].step(
            minutes, rates, where='post', label=well, color=colours.get(well), ls=style, lw=2
        )
    axes[0].set_ylabel('setpoint [ml/h]')
    for label, truth, colour, width in (
        ('with control', controlled, '#12502f', BELOW),
        ('without control', free, '#b03a2e', ABOVE),
    ):
        tracer = truth.disallowed(rig) * ML
        axes[1].plot(truth.times / 60, tracer, color=colour, label=label, lw=width)
    axes[1].set_ylabel('tracer in the zone [ml]')
    minutes = np.array(account.times) / 60
    errors = [('physics-based model', account.prediction_error, '-', BELOW)]
    if any(account.corrected):
        errors.append(('with COSTA', account.corrected_error, '-', ABOVE))
    errors.append(('expected by the\ndeviations', account.expected_error, ':', ABOVE))
    for label, error, line, width in errors:
        axes[2].plot(minutes, 100.0 * np.array(error), line, label=label, lw=width)
    percent_scale(axes[2])
    axes[2].set_ylabel('error of the prediction\nfor this photograph [%]')
    axes[3].plot(minutes, account.cycle_s, label='state to setpoint')
    axes[3].set_ylabel('wall-clock time [s]')
    axes[3].set_ylim(bottom=0.0)
    axes[3].set_xlabel('time since the start of the injection [min]')
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, loc='upper left', bbox_to_anchor=(1.0, 1.0), frameon=False)
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    plt.close(figure)
