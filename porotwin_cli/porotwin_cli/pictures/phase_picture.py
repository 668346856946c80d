"""A sheet of maps of phases with a legend."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from porotwin_cli.options.output_files import maker
from porotwin_cli.pictures.rig_drawing import INTERFACE, PANEL_WIDTH, UNSEEN
from porotwin_core.basis.errors import writing
from porotwin_core.clock.time_units import time_unit
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH, draw_interfaces, draw_water, draw_wells
from porotwin_imaging.phases.phase_colours import PHASES
from porotwin_imaging.phases.phase_measures import SURE
from porotwin_imaging.phases.phase_segmentation import PhaseMap

COLOURS = ('#e9e2d3', '#3f86c4', '#e0a020')
"""Colours of water, dissolved CO2 and gas, which differ for colour-blind readers too."""
DOUBT = '#b03a2e'
"""Colour of cells in doubt."""


def phase_sheet(path: Path, rig: Rig, maps: Mapping[float, PhaseMap], title: str) -> None:
    """Draw maps of phases by time [s] side by side, with a legend, under a title."""
    columns = 2 if len(maps) == 4 else min(3, len(maps))
    rows = -(-len(maps) // columns)
    height = PANEL_WIDTH * rig.height_m / rig.width_m + 0.7
    figure, axes = plt.subplots(
        rows,
        columns,
        figsize=(max(PANEL_WIDTH * columns, 6.5), height * rows + 0.9),
        squeeze=False,
        layout='constrained',
    )
    for axis in axes.flat:
        axis.set_axis_off()
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    unit = time_unit(max(maps))
    palette = ListedColormap(list(COLOURS))
    steps = BoundaryNorm(np.arange(len(PHASES) + 1) - 0.5, len(PHASES))
    for (time, found), axis in zip(maps.items(), axes.flat, strict=False):
        axis.set_axis_on()
        axis.set_facecolor(UNSEEN)
        shown = np.ma.masked_greater_equal(found.phase, len(PHASES))
        axis.imshow(shown, origin='lower', extent=extent, cmap=palette, norm=steps)
        axis.imshow(
            _doubt(found), origin='lower', extent=extent, cmap=ListedColormap([DOUBT]), alpha=0.6
        )
        draw_water(axis, rig)
        draw_wells(axis, rig)
        draw_interfaces(axis, rig, colour=INTERFACE)
        axis.set_title(unit.precise(time))
        axis.set_xlabel('x [m]')
        axis.set_ylabel('z [m]')
    handles = [
        Patch(facecolor=colour, label=name) for colour, name in zip(COLOURS, PHASES, strict=True)
    ]
    handles.append(Patch(facecolor=DOUBT, label=f'less than {100 * SURE:.0f} % sure'))
    handles.append(Patch(facecolor=UNSEEN, label='not seen'))
    figure.legend(handles=handles, loc='outside lower center', ncols=len(handles), frameon=False)
    figure.suptitle(title)
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH, metadata={'Software': maker('segment')})
    plt.close(figure)


def _doubt(found: PhaseMap) -> FloatArray:
    """Return 1 where a phase is in doubt, masked elsewhere, shape (nz, nx)."""
    doubtful = np.nan_to_num(found.confidence, nan=1.0) < SURE
    return np.ma.masked_where(~doubtful, doubtful.astype(float))
