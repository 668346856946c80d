"""From metres in the rig to pixels in the photograph: corners, perspective, bulge and stretch.

A homography maps the rectangle of the rig to the quadrilateral of its four corners in the
photograph. The crop is that quadrilateral, rectified to `columns` x `rows` pixels: the longer one
of each two opposite sides. The lens and the bulging front plate bend lines that the homography
leaves straight; `rig.camera.curvature` describes the bending in pixels of the crop. Let (X, Y) be
the column and row of a point in the corrected crop relative to a centre, which is the middle of the
crop plus the offset of the term. Let the edges of the crop be at X0 < X < X1 and Y0 < Y < Y1. The
photograph shows the point at

    stretch  X' = X + horizontal_stretch X (X1 - X) (X - X0)
             Y' = Y + vertical_stretch   Y (Y1 - Y) (Y - Y0)
    bulge    X" = X' + horizontal_bulge X' (Y1 - Y') (Y' - Y0)
             Y" = Y' + vertical_bulge   Y' (X1 - X') (X' - X0)

in this order, each with its own centre. The terms are the curvature correction of DarSIA, the image
analysis of the FluidFlower. Each vanishes on two edges of the crop, so that the corners do not
move. All keys are optional:

| key | unit | meaning |
| --- | --- | --- |
| `horizontal_bulge`, `vertical_bulge` | 1/px^2 | vertical lines bend sideways, horizontal ones up |
| `horizontal_stretch`, `vertical_stretch` | 1/px^2 | uneven spacing of columns (rows) |
| each of these with `_offset` | px | centre relative to the middle of the crop, right and down |
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Camera, Rig
from porotwin_imaging.numerics.robust_statistics import ROUNDS

Array = NDArray[Any]

TERMS = ('horizontal_bulge', 'vertical_bulge', 'horizontal_stretch', 'vertical_stretch')
"""The terms of the curvature."""
KEYS = frozenset([*TERMS, *(term + '_offset' for term in TERMS)])
"""All keys of `rig.camera.curvature`."""


@dataclass(frozen=True)
class Geometry:
    """The mapping between the plane of a rig and its photographs.

    Attributes:
        width: width of the rig [m].
        height: height of the rig [m].
        columns: columns of the crop [px].
        rows: rows of the crop [px].
        to_photograph: homography from crop to photograph pixels (column, row), shape (3, 3).
        curvature: terms [1/px^2] and offsets [px] by key; see the table of the module.
    """

    width: float
    height: float
    columns: float
    rows: float
    to_photograph: Array
    curvature: dict[str, float]

    @classmethod
    def of(cls, rig: Rig) -> 'Geometry':
        """Return the geometry that `rig.camera` describes.

        Raises:
            InputError: the rig has no camera, or a curvature key is unknown.
        """
        if rig.camera is None:
            raise InputError(f"rig '{rig.name}' has no camera: add camera.corners_px to rig.yaml")
        return cls.from_camera(rig.camera, rig.width_m, rig.height_m)

    @classmethod
    def from_camera(cls, camera: Camera, width: float, height: float) -> 'Geometry':
        """Return the geometry of a rig of `width` x `height` [m] in photographs of `camera`.

        Raises:
            InputError: a curvature key is unknown, or the corners have another order.
        """
        for key in sorted(set(camera.curvature) - KEYS):
            raise InputError(
                f"camera.curvature: unknown term '{key}'; known: {', '.join(sorted(KEYS))}"
            )
        corners = np.array(camera.corners_px, dtype=float)
        _refuse_crossed(corners)
        upper_left, lower_left, lower_right, upper_right = corners
        columns = max(
            np.linalg.norm(upper_right - upper_left), np.linalg.norm(lower_right - lower_left)
        )
        rows = max(
            np.linalg.norm(lower_left - upper_left), np.linalg.norm(lower_right - upper_right)
        )
        crop = np.array([[0, 0], [0, rows], [columns, rows], [columns, 0]])
        homography = cv2.getPerspectiveTransform(
            crop.astype(np.float32), corners.astype(np.float32)
        )
        return cls(width, height, float(columns), float(rows), homography, dict(camera.curvature))

    def to_pixels(self, x: Array, z: Array) -> tuple[Array, Array]:
        """Return (columns, rows) [px] in the photograph of points (x, z) [m], of any shape."""
        column = np.asarray(x, dtype=float) * (self.columns / self.width)
        row = self.rows - np.asarray(z, dtype=float) * (self.rows / self.height)
        column, row = self._stretched(column, row)
        column, row = self._bulged(column, row)
        return apply_homography(self.to_photograph, column, row)

    def to_metres(self, columns: Array, rows: Array) -> tuple[Array, Array]:
        """Return (x, z) [m] of points of the photograph [px], the inverse of `to_pixels`.

        The curvature is inverted by fixed-point iteration. It contracts, because the terms shift
        points by far less than the size of the crop.
        """
        shown = apply_homography(np.linalg.inv(self.to_photograph), columns, rows)
        column, row = shown
        for _ in range(ROUNDS):
            bent = self._bulged(*self._stretched(column, row))
            column, row = column + shown[0] - bent[0], row + shown[1] - bent[1]
        return column * (self.width / self.columns), (self.rows - row) * (self.height / self.rows)

    def _term(self, name: str) -> tuple[float, float]:
        """Return value and offset of a term."""
        return self.curvature.get(name, 0.0), self.curvature.get(name + '_offset', 0.0)

    def _stretched(self, column: Array, row: Array) -> tuple[Array, Array]:
        horizontal, offset_x = self._term('horizontal_stretch')
        vertical, offset_y = self._term('vertical_stretch')
        x = column - self.columns / 2 - offset_x
        y = row - self.rows / 2 - offset_y
        return (
            column + horizontal * x * (self.columns - column) * column,
            row + vertical * y * (self.rows - row) * row,
        )

    def _bulged(self, column: Array, row: Array) -> tuple[Array, Array]:
        horizontal, offset_x = self._term('horizontal_bulge')
        vertical, offset_y = self._term('vertical_bulge')
        x = column - self.columns / 2 - offset_x
        y = row - self.rows / 2 - offset_y
        return (
            column + horizontal * x * (self.rows - row) * row,
            row + vertical * y * (self.columns - column) * column,
        )


def apply_homography(homography: Array, column: Array, row: Array) -> tuple[Array, Array]:
    """Return the points (column, row), arrays of any shape, mapped by a homography (3, 3)."""
    h = homography
    scale = 1.0 / (h[2, 0] * column + h[2, 1] * row + h[2, 2])
    return (
        (h[0, 0] * column + h[0, 1] * row + h[0, 2]) * scale,
        (h[1, 0] * column + h[1, 1] * row + h[1, 2]) * scale,
    )


def _refuse_crossed(corners: Array) -> None:
    """Raise InputError unless the corners are counter-clockwise and begin at the upper left."""
    following = np.roll(corners, -1, axis=0) - corners
    turns = following[:, 0] * np.roll(following[:, 1], -1) - following[:, 1] * np.roll(
        following[:, 0], -1
    )
    order = 'give upper left, lower left, lower right, upper right, as (column, row)'
    if (turns > 0).all():
        raise InputError(
            f'camera.corners_px {corners.tolist()} run clockwise; {order}. If they name the '
            'corners of the rig, its photographs are mirrored: mirror them back'
        )
    if not (turns < 0).all():
        raise InputError(f'camera.corners_px {corners.tolist()} cross each other; {order}')
    if corners[0, 0] >= corners[2, 0] or corners[0, 1] >= corners[2, 1]:
        raise InputError(
            f'camera.corners_px {corners.tolist()} do not begin at the upper left; {order}. If '
            'they name the corners of the rig, its photographs are turned: turn them upright'
        )
