"""The picture of a study: tracer in the zone with bands, and the plumes at the end."""

from pathlib import Path

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from porotwin_cli.options.output_files import maker
from porotwin_cli.pictures.rig_drawing import draw_map
from porotwin_cli.running.what_if_study import REACHED, WhatIfStudy
from porotwin_core.basis.errors import writing
from porotwin_core.basis.units import ML
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH
from porotwin_siblings.outlook import Outlook
from porotwin_siblings.zone_measure import ZoneMeasure

PRESENT, PROPOSED = '#8a5a00', '#1f5fa8'
"""Colours of the two plans; told apart also by those who see no red or green."""

MAP_WIDTH = 6.25
"""Greatest width of one map [inches]."""

MAP_HEIGHT = 5.5
"""Greatest height of one map [inches], so that the picture fits a screen."""

COURSES_HEIGHT, MARGINS = 3.6, 1.1
"""Height of the courses above the maps, and of all titles and labels [inches]."""

Plans = tuple[tuple[str, Outlook, str], ...]
"""Name, outlook and colour of every plan."""

EXPLANATION = (
    'Maps: mean of all siblings at the end. Solid: its outline at a concentration of {level:g}. '
    'Dotted: one standard deviation less and more.'
)

DASHED = ' Dashed: outline at {start}.'
"""Added if there is a plume then."""

HATCHED = ' Hatched: the zone.'
"""Added where there is one."""

SEEN = {
    True: 'maps, bars: their deviation and the noise of clean sand',
    False: 'maps, no deviations known; bars: the noise of clean sand',
}
"""Label of the recorded maps, of photographs or simulated; by whether they tell deviations."""


def what_if_picture(path: Path, study: WhatIfStudy) -> None:
    """Draw both forecasts beside each other; without a zone only their maps."""
    maps = min(MAP_WIDTH * study.rig.height_m / study.rig.width_m, MAP_HEIGHT) + MARGINS
    heights = [COURSES_HEIGHT, maps] if study.has_zone else [maps]
    figure = plt.figure(figsize=(2.0 * MAP_WIDTH, sum(heights)), layout='constrained')
    axes = figure.subplots(len(heights), 2, squeeze=False, height_ratios=heights)
    plans = (('present', study.present, PRESENT), ('proposed', study.proposed, PROPOSED))
    if study.has_zone:
        _draw_courses(axes[0, 0], axes[0, 1], study, plans)
    for axis, (name, outlook, colour) in zip(axes[-1], plans, strict=True):
        _draw_plume(axis, study, name, outlook, colour)
    figure.supxlabel(_explanation(study), fontsize=9)
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH, metadata={'Software': maker('what-if')})
    plt.close(figure)


def _explanation(study: WhatIfStudy) -> str:
    """Return the words below the maps that explain the drawing."""
    words = EXPLANATION.format(level=PLUME_THRESHOLD)
    if np.nanmax(study.state) > PLUME_THRESHOLD:
        words += DASHED.format(start=study.time_unit.precise(study.start))
    return words + HATCHED if study.has_zone else words


def _draw_courses(zone: Axes, reached: Axes, study: WhatIfStudy, plans: Plans) -> None:
    """Draw the tracer in the zone and the probability that it is reached, over time."""
    unit = study.time_unit
    # the noise of a photograph adds up to a millilitre over the zone; the estimate is free of it
    estimated = ZoneMeasure.of(study.rig, study.map_grid).tracer(study.state)
    for (name, outlook, colour), style in zip(plans, ('-', '--'), strict=True):
        times = (study.start + np.array([0.0, *outlook.times])) / unit.seconds
        now = np.full((3, 1), estimated)
        low, median, high = np.hstack([now, outlook.zone_tracer]) * ML
        zone.fill_between(times, low, high, color=colour, alpha=0.2, lw=0)
        zone.plot(times, median, style, color=colour, label=f'{name}, with the 90 % band')
        reached.plot(times[1:], 100.0 * outlook.zone_reached, style, color=colour, label=name)
    if len(study.seen_times) > 1:
        zone.errorbar(
            study.seen_times / unit.seconds,
            study.seen_tracer * ML,
            study.seen_deviation * ML,
            fmt='k.',
            ms=3,
            lw=0.5,
            label=SEEN[study.deviations_known],
        )
    zone.set_ylabel('tracer in the zone [ml]')
    reached.set_ylabel('probability that the zone is reached [%]')
    reached.set_title(f'reached: {REACHED}', fontsize=9)
    reached.set_ylim(-3, 103)
    for axis in (zone, reached):
        axis.set_xlabel(f'time [{unit.name}]')
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)


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
    end = float(study.start + outlook.map_times[-1])
    axis.set_title(f'{name}, at {study.time_unit.precise(end)}')
