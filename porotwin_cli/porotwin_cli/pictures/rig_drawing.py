"""Drawings of a rig: its map of tracer, its wells and the zones of its objective."""

import pathlib
from collections.abc import Sequence

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from porotwin_cli.options.output_files import maker
from porotwin_core.basis.errors import InputError, writing
from porotwin_core.clock.time_units import time_unit
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig
from porotwin_core.rig.control_zones import ZoneKind, control_zones
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH, draw_interfaces, draw_water, draw_wells

SAND_TO_TRACER = LinearSegmentedColormap.from_list('tracer', ['#efe6d8', '#7fae6b', '#12502f'])
"""Colours of the concentrations from 0 to 1."""

INTERFACE = '#6b5b45'
"""Colour of the interfaces between sands."""

ZONE_STYLES: dict[ZoneKind, tuple[str, str | None]] = {
    'keep out': ('#b03a2e', '//'),
    'keep in': ('#1e8449', None),
    'target': ('#2471a3', '..'),
}
"""Colour and hatching of a zone by its purpose."""

UNSEEN = '#b8b8b8'
"""Colour of cells without a value."""


PANEL_WIDTH = 4.2
"""Width of one map [inches]."""

MOST_MAPS = 6
"""Most maps on one sheet: more would be too small to read."""


def draw_map(axis: Axes, rig: Rig, concentration: FloatArray) -> None:
    """Draw a map (nz, nx) [-] on `axis`, with the wells and the zones of `rig`."""
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    axis.set_facecolor(UNSEEN)
    axis.imshow(
        concentration, origin='lower', extent=extent, cmap=SAND_TO_TRACER, vmin=0.0, vmax=1.0
    )
    draw_water(axis, rig)
    draw_zones(axis, rig)
    draw_wells(axis, rig)
    draw_interfaces(axis, rig, colour=INTERFACE)
    axis.set_xlim(0.0, rig.width_m)
    axis.set_ylim(0.0, rig.height_m)
    axis.set_xlabel('x [m]')
    axis.set_ylabel('z [m]')


def draw_zones(axis: Axes, rig: Rig) -> None:
    """Draw the zones of the objective of `rig` on `axis`, in metres."""
    for kind, zone in control_zones(rig):
        colour, hatch = ZONE_STYLES[kind]
        path = Path.make_compound_path(*(Path(outline) for outline in zone.outlines))
        hatched = PathPatch(path, facecolor='none', edgecolor=colour, hatch=hatch, lw=0, alpha=0.6)
        axis.add_patch(hatched)
        for outline in zone.outlines:
            axis.plot(*outline.T, color=colour, lw=1.2)


def percent_scale(axis: Axes) -> None:
    """Give the errors [%] on the vertical `axis` a logarithmic scale with plain numbers."""
    axis.set_yscale('log')
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 6.0)))
    axis.yaxis.set_major_formatter(StrMethodFormatter('{x:g}'))
    axis.yaxis.set_minor_formatter(NullFormatter())


def picture_beside(output: pathlib.Path) -> pathlib.Path:
    """Return the path of the picture that belongs to the file `output`.

    Raises:
        InputError: `output` is not called like a NetCDF file. Two outputs that differ in their
            ending would have one picture.
    """
    if output.suffix != '.nc':
        raise InputError(
            f'{output}: maps are written as NetCDF; give a name that ends in .nc, such as '
            f'{output.with_suffix(".nc").name}'
        )
    return output.with_suffix('.png')


def chosen_maps(count: int) -> list[int]:
    """Return the indices of at most `MOST_MAPS` maps, evenly spread, with the first and last."""
    return sorted({round(index) for index in np.linspace(0, count - 1, min(count, MOST_MAPS))})


def sheet_of_maps(
    path: pathlib.Path,
    rig: Rig,
    times: Sequence[float],
    maps: Sequence[FloatArray],
    title: str,
    *,
    command: str,
) -> None:
    """Draw maps (nz, nx) [-] of the given times [s] side by side, under a title, for a command."""
    columns = min(3, len(maps))
    rows = -(-len(maps) // columns)
    height = PANEL_WIDTH * rig.height_m / rig.width_m + 0.7
    figure, axes = plt.subplots(
        rows,
        columns,
        figsize=(PANEL_WIDTH * columns, height * rows + 0.5),
        squeeze=False,
        layout='constrained',
    )
    for axis in axes.flat:
        axis.set_axis_off()
    unit = time_unit(max(times))
    for time, values, axis in zip(times, maps, axes.flat, strict=False):
        axis.set_axis_on()
        draw_map(axis, rig, values)
        axis.set_title(unit.precise(time))
    scale = ScalarMappable(Normalize(0.0, 1.0), SAND_TO_TRACER)
    figure.colorbar(scale, ax=axes, shrink=0.6, label='concentration: 0 water, 1 tracer stock')
    figure.suptitle(title)
    with writing(path):
        figure.savefig(path, dpi=DOTS_PER_INCH, metadata={'Software': maker(command)})
    plt.close(figure)
