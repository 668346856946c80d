"""Draws the sands of a rig on a raster of small squares, one sand each.

Every square takes the sand at its centre, so an interface is misplaced by at most half a square.
 Grids average the raster over their cells, by area (see `Rig.field`).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import ImageColor

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import MOST_SQUARES, FloatArray, Grid
from porotwin_core.geometry.polygons import inside
from porotwin_core.rig.rig_picture import rig_picture
from porotwin_core.rig.sand_sections import SandImage, SandLayer, SandPolygon

SAND_SQUARE_M = 0.002
"""Side of a square [m]: a few grains of coarse sand, below the accuracy of a packing."""

COLOUR_TOLERANCE = 60.0
"""Largest distance from a colour of the legend, in RGB of 0 to 255: soft edges of a drawing."""

MOST_FOREIGN_PIXELS = 0.01
"""Share of pixels without a colour of the legend that is taken for soft edges."""

LabelArray = NDArray[np.integer]
"""The number of the sand of every square, (nz, nx), row 0 lowest."""


def sand_raster(width: float, height: float) -> Grid:
    """Return the raster over a rig of `width` x `height` [m]."""
    return Grid.of_squares(SAND_SQUARE_M, MOST_SQUARES, width, height)


def draw_layers(layers: tuple[SandLayer, ...], names: tuple[str, ...], raster: Grid) -> LabelArray:
    """Return the sand of every square (nz, nx) from `layers`, the lowest first."""
    labels = np.full(raster.shape, names.index(layers[-1].sand))
    for layer in reversed(layers[:-1]):
        labels[raster.z[:, None] < _top(layer, raster)[None, :]] = names.index(layer.sand)
    return labels


def _top(layer: SandLayer, raster: Grid) -> FloatArray:
    if not isinstance(layer.top_m, tuple):
        return np.full(raster.nx, layer.top_m, dtype=float)
    x, z = np.array(layer.top_m).T
    return np.interp(raster.x, x, z)


def draw_polygons(
    labels: LabelArray, polygons: tuple[SandPolygon, ...], names: tuple[str, ...], raster: Grid
) -> LabelArray:
    """Return `labels` (nz, nx) with `polygons` drawn over them, the last one on top."""
    x, z = np.meshgrid(raster.x, raster.z)
    centres = np.column_stack([x.ravel(), z.ravel()])
    result = labels.ravel().copy()
    for polygon in polygons:
        result[inside(centres, np.array(polygon.corners_m))] = names.index(polygon.sand)
    return result.reshape(raster.shape)


def draw_image(
    description: SandImage, content: bytes, names: tuple[str, ...], raster: Grid, path: Path
) -> LabelArray:
    """Return the sand of every square (nz, nx) from a picture of the whole rig.

    A pixel belongs to the colour of the legend that is nearest to its own.

    Args:
        description: the legend.
        content: the bytes of the picture.
        names: all sands.
        raster: the squares.
        path: the file, for messages.

    Raises:
        InputError: no picture of a rig with this shape, a legend without colours, or pixels of
            other colours.
    """
    try:
        colours = np.array([ImageColor.getrgb(word)[:3] for word in description.legend], float)
    except ValueError as error:
        raise InputError(f"sand_image.legend: {error}; write colours like '#c08040'") from None
    picture = rig_picture(path, content, 'RGB', width_m=raster.width, height_m=raster.height)
    pixels = np.asarray(picture, dtype=float)
    height, width = pixels.shape[:2]
    rows = ((1.0 - raster.z / raster.height) * height).astype(int).clip(0, height - 1)
    columns = (raster.x / raster.width * width).astype(int).clip(0, width - 1)
    chosen = pixels[np.ix_(rows, columns)]
    distance = np.linalg.norm(chosen[:, :, None, :] - colours, axis=3)
    foreign = distance.min(axis=2) > COLOUR_TOLERANCE
    if foreign.mean() > MOST_FOREIGN_PIXELS:
        first = '#{:02x}{:02x}{:02x}'.format(*chosen[foreign][0].astype(int))
        raise InputError(
            f'{path}: {percent(foreign.mean())} of the picture has colours such as {first} that '
            'sand_image.legend does not name; add them'
        )
    sands = np.array([names.index(sand) for sand in description.legend.values()])
    return sands[distance.argmin(axis=2)]
