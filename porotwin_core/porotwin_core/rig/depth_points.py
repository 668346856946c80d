"""The depth of a rig from measured points: linear on triangles, the nearest point beyond them."""

import csv
from pathlib import Path

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.regular_file import open_text
from porotwin_core.geometry.grid import MOST_SQUARES, FloatArray, Grid

DEPTH_SQUARE_M = 0.01
"""Side of the squares of an interpolated depth [m]; plates bend over decimetres."""

HEADER = ('x_m', 'z_m', 'depth_m')


def depth_map(points: FloatArray, width: float, height: float) -> FloatArray:
    """Return the depth [m] over a rig of `width` x `height` [m], (nz, nx), row 0 lowest.

    Args:
        points: (x, z, depth) [m] of the measured points, shape (n, 3).
        width: width of the rig [m].
        height: height of the rig [m].
    """
    grid = Grid.of_squares(DEPTH_SQUARE_M, MOST_SQUARES, width, height)
    x, z = np.meshgrid(grid.x, grid.z)
    return interpolated(points, np.column_stack([x.ravel(), z.ravel()])).reshape(grid.shape)


def interpolated(points: FloatArray, places: FloatArray) -> FloatArray:
    """Return the depth [m] at `places` (n, 2), from `points` (m, 3) of x, z, depth [m].

    Points on one line are interpolated along it.
    """
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator  # slow to import

    where, depth = points[:, :2], points[:, 2]
    centred = where - where.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred, full_matrices=True)
    if len(points) < 3 or sizes[1] <= ROUND_OFF * sizes[0]:  # no triangle
        along = centred @ directions[0]
        order = np.argsort(along)
        offsets = (places - where.mean(axis=0)) @ directions[0]
        return np.interp(offsets, along[order], depth[order])
    linear = LinearNDInterpolator(where, depth, rescale=False)(places)
    return np.where(np.isfinite(linear), linear, NearestNDInterpolator(where, depth)(places))


def read_depth_points(path: Path) -> tuple[tuple[float, float, float], ...]:
    """Return the points (x, z, depth) [m] in the CSV file `path`.

    Raises:
        InputError: the file is missing, has another header, or a line is no three numbers.
    """
    try:
        with open_text(path, 'utf-8-sig') as file:
            lines = [line for line in csv.reader(file) if any(word.strip() for word in line)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{path}: not readable as CSV ({error})') from None
    if not lines or tuple(word.strip() for word in lines[0]) != HEADER:
        raise InputError(f'{path}: the first line must be {",".join(HEADER)}')
    points = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            x, z, depth = (float(word) for word in line)
        except ValueError:
            raise InputError(
                f'{path}:{number}: write three numbers with decimal points: {",".join(HEADER)}'
            ) from None
        points.append((x, z, depth))
    return tuple(points)
