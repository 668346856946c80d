"""From metres in the rig to pixels in the photograph: corners, perspective, bulge and stretch.

A photograph of the rig is first cropped to the quadrilateral of its four corners: a homography
takes the rig's rectangle to the photograph. The crop is measured in pixels, `columns` x `rows`,
the longer of the two opposite sides of the quadrilateral each way. Lens and bulging front plate
bend lines that the homography leaves straight; `rig.camera.curvature` describes that in crop
pixels. With (X, Y) the column and row of a point in the corrected crop relative to a centre (half
the crop plus the term's offset), and the crop's edges at X0 < X < X1, Y0 < Y < Y1, the point is
seen at

    stretch  X' = X + horizontal_stretch X (X1 - X) (X - X0)
             Y' = Y + vertical_stretch   Y (Y1 - Y) (Y - Y0)
    bulge    X" = X' + horizontal_bulge X' (Y1 - Y') (Y' - Y0)
             Y" = Y' + vertical_bulge   Y' (X1 - X') (X' - X0)

in this order, each with its own centre. These are the terms published with the FluidFlower's
image analysis (DarSIA, curvature correction). Both vanish on the crop's edges in one direction, so
the corners stay where they are. All keys are optional:

| key | unit | meaning |
| --- | --- | --- |
| `horizontal_bulge`, `vertical_bulge` | 1/px^2 | vertical lines bend sideways, horizontal ones up |
| `horizontal_stretch`, `vertical_stretch` | 1/px^2 | columns (rows) are spaced unevenly |
| each of these with `_offset` | px | its centre, from the middle of the crop, right and down |
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.rig import Camera, Rig

Array = NDArray[Any]

TERMS = ('horizontal_bulge', 'vertical_bulge', 'horizontal_stretch', 'vertical_stretch')
KEYS = frozenset([*TERMS, *(term + '_offset' for term in TERMS)])


@dataclass(frozen=True)
class Geometry:
    """Where each point of a rig of `width` x `height` [m] lies in its photographs.

    `columns`, `rows`: size of the crop [px]; `to_photograph`: homography (3, 3) from crop to
    photograph pixels (column, row); `curvature`: the terms above.
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
        """Return the geometry of a rig of `width` x `height` [m] seen by `camera`."""
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

    @property
    def pixels_per_metre(self) -> float:
        """Resolution of the photograph in the rig's plane, the coarser direction [px/m]."""
        return min(self.columns / self.width, self.rows / self.height)

    def to_pixels(self, x: Array, z: Array) -> tuple[Array, Array]:
        """Return (columns, rows) in the photograph of the points (x, z) [m] of the rig."""
        column = np.asarray(x, dtype=float) * (self.columns / self.width)
        row = self.rows - np.asarray(z, dtype=float) * (self.rows / self.height)
        column, row = self._stretched(column, row)
        column, row = self._bulged(column, row)
        return apply_homography(self.to_photograph, column, row)

    def to_metres(self, columns: Array, rows: Array) -> tuple[Array, Array]:
        """Return (x, z) [m] of points of the photograph; the inverse of `to_pixels`.

        The curvature is undone by fixed-point iteration, which contracts since the terms shift
        points by far less than the crop's size.
        """
        seen = apply_homography(np.linalg.inv(self.to_photograph), columns, rows)
        column, row = seen
        for _ in range(20):
            bent = self._bulged(*self._stretched(column, row))
            column, row = column + seen[0] - bent[0], row + seen[1] - bent[1]
        return column * (self.width / self.columns), (self.rows - row) * (self.height / self.rows)

    def _term(self, name: str) -> tuple[float, float]:
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
    """Return the points (column, row) moved by a homography (3, 3)."""
    h = homography
    scale = 1.0 / (h[2, 0] * column + h[2, 1] * row + h[2, 2])
    return (
        (h[0, 0] * column + h[0, 1] * row + h[0, 2]) * scale,
        (h[1, 0] * column + h[1, 1] * row + h[1, 2]) * scale,
    )


def _refuse_crossed(corners: Array) -> None:
    """Raise InputError unless the corners run counter-clockwise on the picture, from upper left."""
    following = np.roll(corners, -1, axis=0) - corners
    turns = following[:, 0] * np.roll(following[:, 1], -1) - following[:, 1] * np.roll(
        following[:, 0], -1
    )
    if not (turns < 0).all() or corners[0, 0] >= corners[2, 0] or corners[0, 1] >= corners[2, 1]:
        raise InputError(
            f'camera.corners_px {corners.tolist()}: give upper left, lower left, lower right, '
            'upper right, as (column, row)'
        )
