"""The zone of the objective from a file: a picture of the whole rig, or a NetCDF map."""

from pathlib import Path

import numpy as np
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.geometry.zone_shapes import PictureZone
from porotwin_core.rig.property_file import read_map
from porotwin_core.rig.rig_picture import rig_picture
from porotwin_core.rig.sand_drawing import sand_raster

KEY = 'control.zone'
"""The key of rig.yaml, for messages."""


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
        content = read_regular(file)
    except OSError as error:
        raise InputError(f'{file}: cannot be read ({error.strerror})') from None
    layers = rig_picture(file, content, 'LA', width_m=raster.width, height_m=raster.height)
    shrunk = layers.resize((raster.nx, raster.nz), Image.Resampling.BOX)
    light, opacity = np.moveaxis(np.asarray(shrunk, dtype=float), -1, 0) / 255.0
    return np.asarray((light * opacity)[::-1])


def _from_map(file: Path, variable: str, width: float, height: float) -> FloatArray:
    """Return the share of each cell in the zone, (nz, nx), on no finer a grid than pictures have.

    Raises:
        InputError: no map of shares over the rig.
    """
    shares = read_map(file, variable, KEY, (width, height))
    if not (np.isfinite(shares).all() and shares.min() >= -WRITTEN_ROUND_OFF):
        raise InputError(f'{file}: {variable} must be a share from 0 to 1 in every cell')
    if shares.max() > 1.0 + WRITTEN_ROUND_OFF:
        raise InputError(
            f'{file}: {variable} reaches {shares.max():g}; it must be a share from 0 to 1'
        )
    most = sand_raster(width, height)
    rows, columns = min(shares.shape[0], most.nz), min(shares.shape[1], most.nx)
    return np.clip(conservative_resample(shares, (rows, columns)), 0.0, 1.0)
