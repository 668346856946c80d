"""Signals that tracer cannot make: another dye, a pH indicator, gas, coloured light, a hard shadow.

Tracer darkens every colour channel, in the proportions of its dye. A cell whose change has another
sign or another colour shows something else, and a number there would be read as tracer or as clean
sand. These cells have no value.

A dark tube has the wrong colour where it fills a cell, and looks like tracer where it crosses a
plume or fills half a cell. The dark line through the cells of the wrong colour is left out as well.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.geometry.frame import TOLD_SHARE
from porotwin_imaging.light.light_check import REACH, window_mean
from porotwin_imaging.light.light_drift import LIGHT
from porotwin_imaging.numerics.channels import channel_max, channel_mean
from porotwin_imaging.tracer.tracer_colour import STRONG_HUE, TracerColour, split


@dataclass(frozen=True)
class ForeignSignalSettings:
    """Changes that tracer cannot make (`foreign_signal.py`).

    The limits hold for averages over small windows. In brackets: the largest values on real and
    rendered photographs of tracer.
    """

    most_turned: float = 0.8
    """Hue across the direction of the dye relative to the hue along it [-] (0.6)."""
    least_dark: float = 0.15
    """Darkening from which the hue of the dye must be seen [log ratio]."""
    least_hue: float = 0.3
    """Hue relative to the hue of tracer that darkens as much [-] (0.5)."""
    line_cells: int = 7
    """Cells across a window that a thin line does not fill: tubes are thinner."""
    line_depth: float = 0.08
    """Darkening of a thin line relative to its sides [log ratio] (0.05): 5 % of stock."""


FOREIGN_SIGNAL = ForeignSignalSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

_SPECK = (2, 2)
"""Places smaller than this are noise [cells]."""
_GRAINS = 3.0
"""Darkening of a line over the median of all places [-]. Normal noise has a median of about two
standard deviations there, and hardly a cell is three times as dark."""


def without_foreign_signal(
    residual: Array,
    visible: Mask,
    colour: TracerColour | None,
    scatter: float = 0.0,
) -> tuple[Mask, list[str]]:
    """Return the visible cells (nz, nx) whose change of light tracer can make, and remarks.

    Args:
        residual: log ratio to the baseline without the drift of light, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        colour: colour of the tracer, None if it is unknown or grey; then only the sign is checked.
        scatter: by how much places of the same light differ between the two photographs [log].
    """
    smooth = window_mean(residual, visible)
    foreign = channel_max(smooth) > LIGHT.most_brighter + scatter
    if colour is not None:
        foreign |= _another_colour(smooth, colour)
    foreign &= visible
    foreign = cv2.morphologyEx(
        foreign.astype(np.uint8), cv2.MORPH_OPEN, np.ones(_SPECK, np.uint8)
    ).astype(bool)
    foreign |= _dark_lines(residual, visible, foreign)
    count = max(1, int(visible.sum()))
    if not foreign.any():
        return visible, []
    left_out = cv2.dilate(foreign.astype(np.uint8), REACH) > 0
    lost = float((left_out & visible).sum() / count)
    part = f'{100 * lost:.1f} % of the sand'
    remark = f'{part} has a colour that tracer cannot make: this part is left out'
    return visible & ~left_out, [remark] if lost > TOLD_SHARE else []


def _dark_lines(residual: Array, visible: Mask, foreign: Mask) -> Mask:
    """Return the cells of thin dark lines (nz, nx) that pass through `foreign` cells.

    A line is darker than the grain of the sand, which fine cells show as lines everywhere.
    """
    if not foreign.any():
        return foreign
    darkening = -np.where(visible, channel_mean(residual), 0.0).astype(np.float32)
    around = np.ones((FOREIGN_SIGNAL.line_cells,) * 2, np.uint8)
    relief = cv2.morphologyEx(darkening, cv2.MORPH_TOPHAT, around)
    grain = _GRAINS * float(np.median(relief[visible]))
    thin = relief > max(FOREIGN_SIGNAL.line_depth, grain)
    joined = ((thin & visible) | foreign).astype(np.uint8)
    _, parts = cv2.connectedComponents(joined, connectivity=8)
    return np.asarray(np.isin(parts, np.unique(parts[foreign])))


def _another_colour(smooth: Array, colour: TracerColour) -> Mask:
    """Return where (nz, nx) the hue is not the hue of tracer, or where it is missing."""
    grey, hue = split(smooth)
    along = hue @ colour.direction.astype(hue.dtype)
    across = np.linalg.norm(hue - along[..., None] * colour.direction, axis=2)
    turned = across > STRONG_HUE + FOREIGN_SIGNAL.most_turned * np.maximum(along, 0.0)
    opposite = along < -STRONG_HUE
    dark = grey < -FOREIGN_SIGNAL.least_dark
    colourless = dark & (along < FOREIGN_SIGNAL.least_hue * colour.strength * -grey)
    return np.asarray(turned | opposite | colourless, bool)
