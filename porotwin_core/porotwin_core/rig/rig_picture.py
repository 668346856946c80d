"""Painted pictures of the whole rig: its sands or a zone."""

import io
import warnings
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.orientation import UPRIGHT, orientation

SHAPE_TOLERANCE = 0.05
"""Largest relative difference of the sides of picture and rig: a frame of some pixels."""

LEAST_COLUMNS = 500
"""Columns of a picture that shows a rig well, for messages."""


def rig_picture(
    file: Path, content: bytes, mode: str, *, width_m: float, height_m: float
) -> Image.Image:
    """Return the picture of a rig, its first row on top.

    Args:
        file: the file, for messages.
        content: its bytes.
        mode: of the pixels, as Pillow names it, such as RGB.
        width_m: width of the rig.
        height_m: height of the rig.

    Raises:
        InputError: no picture, one that viewers turn, or one of another shape than the rig.
    """
    if (turned := orientation(content)) != UPRIGHT:
        raise InputError(
            f'{file}: EXIF orientation {turned} is not applied, but a viewer turns the picture by '
            'it; turn its pixels, and save it without EXIF'
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of a large picture; its size is judged here
            opened = Image.open(io.BytesIO(content))
        with opened:
            check_declared(file, (*opened.size, len(mode), np.float64().itemsize))
            picture = opened.convert(mode)
    except Image.DecompressionBombError as error:
        raise InputError(f'{file}: {error}; save it smaller') from None
    except (UnidentifiedImageError, OSError):
        raise InputError(f'{file}: not a readable picture; save it as PNG') from None
    columns, rows = picture.size
    if abs(columns / rows * height_m / width_m - 1.0) > SHAPE_TOLERANCE:
        columns_shown = max(columns, LEAST_COLUMNS)
        fitting = round(columns_shown * height_m / width_m)
        raise InputError(
            f'{file}: {columns} x {rows} pixels do not have the shape of the rig of '
            f'{width_m:g} m x {height_m:g} m; cut it to the sand, such as '
            f'{columns_shown} x {fitting} pixels'
        )
    return picture
