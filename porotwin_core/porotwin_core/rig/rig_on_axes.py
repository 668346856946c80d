"""Wells, water and sands of a rig on a plot in metres, the same in all pictures."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from porotwin_core.rig import Rig, Well
from porotwin_core.rig.sand_interfaces import interfaces
from porotwin_core.rig.well_colours import well_colours

DOTS_PER_INCH = 120
"""Resolution of all pictures: figures of 12 inches are sharp on a page of 1080 pixels."""


def draw_wells(axis: Axes, rig: Rig, *, dark: bool = False) -> None:
    """Draw the wells of `rig` on `axis` in their colours, with names in white on a `dark` map."""
    ink, ground = ('w', 'k') if dark else ('k', 'w')
    colours = well_colours(rig)
    for name, well in rig.wells.items():
        axis.plot(well.x_m, well.z_m, 'o', ms=6, mfc='w', mec='k', mew=0.8)
        axis.plot(well.x_m, well.z_m, 'o', ms=3.5, mfc=colours[name], mec='none')
        to_the_left = _has_no_room_right(well, rig)
        axis.annotate(
            name,
            (well.x_m, well.z_m),
            xytext=(-4 if to_the_left else 4, 3),
            textcoords='offset points',
            ha='right' if to_the_left else 'left',
            fontsize=7,
            color=ink,
            path_effects=[withStroke(linewidth=2, foreground=ground, alpha=0.8)],
        )


WATER, OPEN_WATER = '#2471a3', '#a8cbe6'
"""Colours of the water at sides, and in the picture."""


def draw_water(axis: Axes, rig: Rig) -> None:
    """Draw open water, and the water at the sides of `rig`: dotted where it comes at a rate."""
    for name, body in rig.water_bodies.items():
        place = water_place(rig, name)
        if body.side is None:
            axis.fill(*place.T, facecolor=OPEN_WATER, edgecolor=WATER, lw=0.8)
        else:
            axis.plot(*place.T, color=WATER, lw=4, ls='-' if body.rate_ml_h is None else ':')


def water_place(rig: Rig, name: str) -> NDArray[np.float64]:
    """Return the corners (x, z) [m] of the open water `name`, or both ends of it at a side."""
    body = rig.water_bodies[name]
    if body.corners_m is not None:
        return np.array(body.corners_m)
    width, height = rig.width_m, rig.height_m
    if body.side in ('left', 'right'):
        x = 0.0 if body.side == 'left' else width
        return np.array([[x, body.from_m], [x, body.to_m or height]])
    z = 0.0 if body.side == 'bottom' else height
    return np.array([[body.from_m, z], [body.to_m or width, z]])


def _has_no_room_right(well: Well, rig: Rig) -> bool:
    """Return whether the edge or another well leaves no room for a name right of a well."""
    return well.x_m > 0.8 * rig.width_m or any(
        0.0 < other.x_m - well.x_m < 0.3 * rig.width_m
        and abs(other.z_m - well.z_m) < 0.08 * rig.height_m
        for other in rig.wells.values()
    )


def draw_interfaces(axis: Axes, rig: Rig, *, colour: str) -> None:
    """Draw the interfaces between the sands of `rig`."""
    found = interfaces(rig)
    if found is not None:
        axis.contour(
            found.grid.x, found.grid.z, found.logarithm, levels=found.levels, colors=colour,
            linestyles='-', linewidths=0.7,
        )  # fmt: skip
