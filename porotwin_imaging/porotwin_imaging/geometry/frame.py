"""The part of the rig that leaves the frame when the camera moves.

A photograph shows nothing beyond its edges. Black there would read as tracer stock, so samples
outside the frame are not used, and cells without samples have no value.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.geometry.corners_and_lens import apply_homography
from porotwin_imaging.geometry.sampling import Sampling


@dataclass(frozen=True)
class ValiditySettings:
    """Which cells of one photograph show their sand (`validity.py`)."""

    least_visible_share: float = 0.3
    """Share of a cell that must be visible for the cell, or a coarser one, to count [-]."""
    most_clipped_samples: float = 0.05
    """Share of over-exposed samples above which a cell has no value [-]. The darker grains that
    remain are not the same everywhere."""
    most_left_out: float = 0.25
    """Photographs that lose more than this share of the sand to over-exposure, or to reflections
    and foreign colours with their surroundings, are refused [-]."""
    most_hidden: float = 0.4
    """Photographs that hide or damage more than this share of the sand are refused [-]."""
    least_correlation: float = 0.25
    """Correlation with the grains of the baseline below which they are hidden [-]. It is 0.3 behind
    the strongest tracer of the real photographs, and about 0 on a hand or in a damaged file."""
    least_texture: float = 0.02
    """Contrast of grains in the baseline below which there is no pattern to compare [-]."""
    least_judged_share: float = 0.5
    """Visible share of a block of cells from which its grains and its tone are judged [-]."""
    windows_across: int = 40
    """Grain patterns are compared in windows of this fraction of the width of the rig."""


VALIDITY = ValiditySettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

LARGE_SHARE = 0.005
"""Share of the rig from which other light is told, a hole of the baseline, or a sand [-]: bolts and
glass reflect less."""
TOLD_SHARE = 1e-3
"""Least share of the sand whose loss is told [-]: less is the edge of an ordinary shake, or some
cells at a wire."""


def visible_means(plane: Array, visible: Mask, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Return the mean of the visible cells over blocks of cells, and the visible share of a block.

    `plane` has the shape (nz, nx, ...), and `visible` (nz, nx); `shape` is that of the blocks.
    """
    share, sums = (
        cv2.resize(one.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
        for one in (visible, np.where(visible[..., None], plane, 0.0))
    )
    return sums / np.maximum(share, VALIDITY.least_visible_share)[..., None], share


def in_frame(sampling: Sampling, homography: Array, shape: tuple[int, ...]) -> Mask | None:
    """Return where the samples (rows, columns) lie in the photograph; None if all of them do.

    Args:
        sampling: sampling points in the baseline.
        homography: from baseline pixels to photograph pixels, shape (3, 3).
        shape: rows and columns of the decoded photograph.
    """
    columns, rows = sampling.columns, sampling.rows
    border = [
        np.concatenate([plane[0], plane[-1], plane[:, 0], plane[:, -1]])
        for plane in (columns, rows)
    ]
    if _inside(homography, border[0], border[1], shape).all():
        return None
    return _inside(homography, columns, rows, shape)


def _inside(homography: Array, columns: Array, rows: Array, shape: tuple[int, ...]) -> Mask:
    """Return where points of the baseline lie in a photograph of `shape` (rows, columns)."""
    column, row = apply_homography(homography.astype(np.float32), columns, rows)
    inside = (column >= 0) & (row >= 0) & (column <= shape[1] - 1) & (row <= shape[0] - 1)
    return np.asarray(inside, bool)


def frame_remarks(share: Array, framed: Array) -> list[str]:
    """Return a remark if sand has left the frame.

    Args:
        share: share of each cell that the baseline shows, shape (nz, nx).
        framed: the part of `share` that lies in the photograph.

    Raises:
        InputError: too much of the sand has left the frame.
    """
    sand = share > VALIDITY.least_visible_share
    lost = float((sand & (framed <= VALIDITY.least_visible_share)).sum() / max(1, sand.sum()))
    if lost > VALIDITY.most_hidden:
        raise InputError(
            f'photograph does not show {100 * lost:.0f} % of the sand: the camera has moved too '
            'far; set it back or take a new baseline'
        )
    if lost < TOLD_SHARE:
        return []
    return [f'{100 * lost:.1f} % of the sand has left the frame: unknown']
