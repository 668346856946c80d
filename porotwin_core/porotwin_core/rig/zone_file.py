"""The zone of the objective from a file: a picture of the whole rig, or a NetCDF map."""

from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig.property_file import read_map
from porotwin_core.rig.sand_drawing import sand_raster
from porotwin_core.zone_shapes import PictureZone

KEY = 'control.zone'
"""The key of rig.yaml, for messages."""

SHAPE_TOLERANCE = 0.05
"""Largest relative difference of the sides of picture and rig: a frame of some pixels."""

LEAST_COLUMNS = 500
"""Columns of a picture that shows a zone well, for messages."""

ROUND_OFF = 1e-6
"""Share beyond 0 and 1 that is round-off."""


def read_zone(file: Path, variable: str, width: float, height: float) -> PictureZone:
    """Return the zone that `file` shows, of a rig of `width` x `height` [m].

    Bright pixels of a picture lie in the zone, black and transparent ones outside.

    Args:
        file: a picture of the whole rig, or a NetCDF file (.nc).
        variable: of a NetCDF file: the share of each cell in the zone, (z, x).
        width: of the rig [m].
        height: of the rig [m].

    Raises:
        InputError: the file cannot be read, has another shape than the rig, or shows no zone.
    """
    if not file.is_file():
        raise InputError(f'{file}: no such file; {KEY} names it, relative to rig.yaml')
    if file.suffix.lower() == '.nc':
        shares = _from_map(file, variable, width, height)
        raster = Grid(shares.shape[1], shares.shape[0], width, height)
    else:
        raster = sand_raster(width, height)
        shares = _from_picture(file, raster)
    # in single precision, as messages carry it: all nodes then have the same zone
    zone = PictureZone(shares.astype(np.float32).astype(float), raster)
    if not zone.within.any():
        raise InputError(
            f'{file}: shows no zone: less than half of every square of {raster.dx * 1000:.2g} mm '
            'is bright; paint the zone white'
        )
    if zone.within.all():
        raise InputError(
            f'{file}: at least half bright everywhere: paint the zone white and all else black'
        )
    return zone


def _from_picture(file: Path, raster: Grid) -> FloatArray:
    """Return the share of each square of `raster` that is bright, (nz, nx).

    Raises:
        InputError: no picture, or none of a rig with this shape.
    """
    try:
        with Image.open(file) as picture:
            layers = picture.convert('LA')
    except Image.DecompressionBombError as error:
        raise InputError(f'{file}: {error}; save it smaller') from None
    except (UnidentifiedImageError, OSError):
        raise InputError(f'{file}: not a readable picture; save it as PNG') from None
    columns, rows = layers.size
    shape = columns / rows * raster.height / raster.width
    if abs(shape - 1.0) > SHAPE_TOLERANCE:
        columns_shown = max(columns, LEAST_COLUMNS)
        fitting = round(columns_shown * raster.height / raster.width)
        raise InputError(
            f'{file}: {columns} x {rows} pixels do not have the shape of the rig of '
            f'{raster.width:g} m x {raster.height:g} m; cut it to the sand, such as '
            f'{columns_shown} x {fitting} pixels'
        )
    shrunk = layers.resize((raster.nx, raster.nz), Image.Resampling.BOX)
    light, opacity = np.moveaxis(np.asarray(shrunk, dtype=float), -1, 0) / 255.0
    return np.asarray((light * opacity)[::-1])


def _from_map(file: Path, variable: str, width: float, height: float) -> FloatArray:
    """Return the share of each cell in the zone, (nz, nx), on no finer a grid than pictures have.

    Raises:
        InputError: no map of shares over the rig.
    """
    shares = read_map(file, variable, KEY, (width, height))
    if not (np.isfinite(shares).all() and shares.min() >= -ROUND_OFF):
        raise InputError(f'{file}: {variable} must be a share from 0 to 1 in every cell')
    if shares.max() > 1.0 + ROUND_OFF:
        raise InputError(
            f'{file}: {variable} reaches {shares.max():g}; it must be a share from 0 to 1'
        )
    most = sand_raster(width, height)
    rows, columns = min(shares.shape[0], most.nz), min(shares.shape[1], most.nx)
    return np.clip(conservative_resample(shares, (rows, columns)), 0.0, 1.0)
