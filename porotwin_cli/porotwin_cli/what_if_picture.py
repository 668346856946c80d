"""The picture of a study: tracer in the zone with bands, and the plumes at the end."""

from pathlib import Path

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from porotwin_cli.output_files import maker
from porotwin_cli.rig_drawing import DPI, draw_map
from porotwin_cli.what_if_study import NO_ZONE, REACHED, WhatIfStudy
from porotwin_core.errors import writing
from porotwin_core.units import ML
from porotwin_siblings.outlook import Outlook
from porotwin_siblings.zone_measure import ZoneMeasure
from porotwin_solver.quantities import PLUME_THRESHOLD

PRESENT, PROPOSED = '#8a5a00', '#1f5fa8'
"""Colours of the two plans; told apart also by those who see no red or green."""

EXPLANATION = (
    'Maps: mean of all siblings at the end. Solid: its outline at a concentration of {level:g}. '
    'Dotted: one standard deviation less and more. Dashed: outline at {start:.4g} min. '
    'Hatched: the zone.'
)


SEEN = {
    True: 'maps, bars: their deviation and the noise of clean sand',
    False: 'maps, no deviations known; bars: the noise of clean sand',
}
"""Label of the recorded maps, of photographs or simulated; by whether they tell deviations."""


def what_if_picture(path: Path, study: WhatIfStudy) -> None:
    """Draw both forecasts beside each other."""
    figure = plt.figure(figsize=(12.5, 7.2), layout='constrained')
    zone, reached, *maps = figure.subplot_mosaic([['z', 'r'], ['a', 'b']]).values()
    plans = (('present', study.present, PRESENT), ('proposed', study.proposed, PROPOSED))
    # the noise of a photograph adds up to a millilitre over the zone; the estimate is free of it
    estimated = ZoneMeasure.of(study.rig, study.map_grid).tracer(study.state)
    for (name, outlook, colour), style in zip(plans, ('-', '--'), strict=True):
        minutes = (study.start + np.array([0.0, *outlook.times])) / 60.0
        now = np.full((3, 1), estimated)
        low, median, high = np.hstack([now, outlook.zone_tracer]) * ML
        zone.fill_between(minutes, low, high, color=colour, alpha=0.2, lw=0)
        zone.plot(minutes, median, style, color=colour, label=f'{name}, with the 90 % band')
        reached.plot(minutes[1:], 100.0 * outlook.zone_reached, style, color=colour, label=name)
    if len(study.seen_times) > 1:
        zone.errorbar(
            study.seen_times / 60.0,
            study.seen_tracer * ML,
            study.seen_deviation * ML,
            fmt='k.',
            ms=3,
            lw=0.5,
            label=SEEN[study.deviations_known],
        )
    if np.isnan(study.seen_tracer[0]):
        zone.text(0.5, 0.5, NO_ZONE, ha='center', transform=zone.transAxes)
    zone.set_ylabel('tracer in the zone [ml]')
    reached.set_ylabel('probability that the zone is reached [%]')
    reached.set_title(f'reached: {REACHED}', fontsize=9)
    reached.set_ylim(-3, 103)
    for axis in (zone, reached):
        axis.set_xlabel('time [min]')
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    for axis, (name, outlook, colour) in zip(maps, plans, strict=True):
        _draw_plume(axis, study, name, outlook, colour)
    words = EXPLANATION.format(level=PLUME_THRESHOLD, start=study.start / 60.0)
    figure.supxlabel(words, fontsize=9)
    with writing(path):
        figure.savefig(path, dpi=DPI, metadata={'Software': maker('what-if')})
    plt.close(figure)


def _draw_plume(axis: Axes, study: WhatIfStudy, name: str, outlook: Outlook, colour: str) -> None:
    """Draw the mean map at the end with its outline, its doubt, and the outline at the start."""
    draw_map(axis, study.rig, outlook.mean[-1])
    x, z = np.meshgrid(study.grid.x, study.grid.z)
    mean, spread = outlook.mean[-1], outlook.deviation[-1]
    for values, style in ((mean, '-'), (mean - spread, ':'), (mean + spread, ':')):
        axis.contour(x, z, values, levels=[PLUME_THRESHOLD], colors=colour, linestyles=style)
    x, z = np.meshgrid(study.map_grid.x, study.map_grid.z)
    axis.contour(
        x, z, study.state, levels=[PLUME_THRESHOLD], colors='black', linestyles='--',
        linewidths=0.8,
    )  # fmt: skip
    end = (study.start + outlook.map_times[-1]) / 60.0
    axis.set_title(f'{name}, at {end:.1f} min')
