"""The virtual camera: from metres in the rig's plane to pixels, with tilt and lens bulge.

A tilted pinhole camera gives a homography. The lens bends straight lines by a radial (barrel) term,
p = m + (p' - m)(1 + bulge |p' - m|^2 / R^2) with m the middle and R half the diagonal of the
photograph. The owner of the rig knows only the section `camera` of rig.yaml, with corners and
fitted curvature terms.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from porotwin_core.model.blind_draw import SMALL_WIDTH_M
from porotwin_core.rig import Camera, Rig

FloatArray = NDArray[np.floating]

CHART_WIDTH = 0.105
"""Width of the six columns of patches of the colour chart [m]."""

CHART_HEIGHT = CHART_WIDTH * 4.0 / 6.0
"""Height of its four rows of patches [m]."""


TERMS = ('horizontal_bulge', 'vertical_bulge', 'horizontal_stretch', 'vertical_stretch')
"""Names of the terms of the published curvature correction."""

ASPECT = 0.625
"""Default height of a photograph relative to its width."""


@dataclass(frozen=True)
class SceneLayout:
    """The scene in front of the camera, in metres (x right, z up) from the lower left of the sand.

    A frame of width `side` surrounds the sand left, right and below. A board of height `board`
    above it carries the colour chart.

    Args:
        width: width of the sand [m].
        height: height of the sand [m].
    """

    width: float
    height: float

    @property
    def scale(self) -> float:
        """Size of frame and chart relative to the small rig."""
        return max(1.0, self.width / SMALL_WIDTH_M)

    @property
    def side(self) -> float:
        """Width of the frame beside and below the sand [m]."""
        return 0.03 * self.scale

    @property
    def board(self) -> float:
        """Height of the board above the sand [m]."""
        return 0.11 * self.scale

    def chart_point(self, column: float, row: float) -> tuple[float, float]:
        """Return (x, z) [m] of a point of the chart; columns 0..6 to the right, rows 0..4 down."""
        left = 0.02 * self.scale
        top = self.height + 0.5 * (self.board + CHART_HEIGHT * self.scale)
        return (
            left + column * CHART_WIDTH * self.scale / 6.0,
            top - row * CHART_HEIGHT * self.scale / 4.0,
        )


@dataclass(frozen=True)
class VirtualCamera:
    """A camera in front of a scene; pixels are (column, row) from the upper left.

    Args:
        layout: the scene.
        width_px: width of the photographs [px].
        height_px: height of the photographs [px].
        tilt: displacement of the corners of the scene relative to the width [-].
        bulge: the barrel term [-], negative; -0.03 moves the corners by 3 % of half the diagonal.
    """

    layout: SceneLayout
    width_px: int
    height_px: int
    tilt: float = 0.006
    bulge: float = -0.03

    @cached_property
    def homography(self) -> FloatArray:
        """Homography (3, 3) from metres to pixels for a lens without bulge."""
        layout = self.layout
        left, right = -layout.side, layout.width + layout.side
        bottom, top = -layout.side, layout.height + layout.board
        scale = 0.985 * min(self.width_px / (right - left), self.height_px / (top - bottom))
        middle = (0.5 * (left + right), 0.5 * (bottom + top))
        scene = np.array([[left, top], [left, bottom], [right, bottom], [right, top]])
        pixels = np.stack(
            (
                0.5 * self.width_px + scale * (scene[:, 0] - middle[0]),
                0.5 * self.height_px - scale * (scene[:, 1] - middle[1]),
            ),
            axis=1,
        )
        displaced = np.array([[0.6, 0.3], [-0.2, -0.5], [0.4, 0.8], [-0.9, -0.2]])
        pixels += displaced * (self.tilt * self.width_px)
        return np.asarray(
            cv2.getPerspectiveTransform(scene.astype(np.float32), pixels.astype(np.float32)), float
        )

    @property
    def _middle(self) -> tuple[float, float]:
        return 0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1)

    @property
    def _half_diagonal2(self) -> float:
        return 0.25 * (self.width_px**2 + self.height_px**2)

    def to_pixels(self, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the pixels (column, row) of points (x, z) [m]; arrays of one shape."""
        column, row = _project(self.homography, x, z)
        mx, my = self._middle
        along, down = column - mx, row - my
        factor = 1.0 + self.bulge * (along**2 + down**2) / self._half_diagonal2
        return mx + along * factor, my + down * factor

    def to_metres(self, column: FloatArray, row: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points (x, z) [m] of pixels; the inverse of `to_pixels`, by fixed-point
        iteration."""
        mx, my = self._middle
        seen_along, seen_down = np.asarray(column) - mx, np.asarray(row) - my
        along, down = seen_along, seen_down
        for _ in range(6):
            factor = 1.0 + self.bulge * (along**2 + down**2) / self._half_diagonal2
            along, down = seen_along / factor, seen_down / factor
        return _project(np.linalg.inv(self.homography), along + mx, down + my)

    def description(self) -> Camera:
        """Return the section `camera` of rig.yaml, as an owner would measure it."""
        layout = self.layout
        corners = self._pixels_of(
            [(0, layout.height), (0, 0), (layout.width, 0), (layout.width, layout.height)]
        )
        chart = self._pixels_of(
            [layout.chart_point(*point) for point in ((0, 0), (0, 4), (6, 4), (6, 0))]
        )
        return Camera(
            corners_px=corners,
            colour_checker_px=chart,
            curvature=fitted_curvature(self),
        )

    def _pixels_of(self, points: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        x, z = np.array(points, dtype=float).T
        column, row = self.to_pixels(x, z)
        return tuple(
            (round(float(c), 2), round(float(r), 2)) for c, r in zip(column, row, strict=True)
        )


def camera_before(rig: Rig, width_px: int = 1600, height_px: int | None = None) -> VirtualCamera:
    """Return a camera that sees the whole of `rig`; the default aspect is 16:10."""
    if height_px is None:
        height_px = round(width_px * ASPECT)
    return VirtualCamera(SceneLayout(rig.width_m, rig.height_m), width_px, height_px)


def _project(homography: FloatArray, a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    h = homography
    scale = 1.0 / (h[2, 0] * a + h[2, 1] * b + h[2, 2])
    return (
        (h[0, 0] * a + h[0, 1] * b + h[0, 2]) * scale,
        (h[1, 0] * a + h[1, 1] * b + h[1, 2]) * scale,
    )


def fitted_curvature(camera: VirtualCamera) -> dict[str, float]:
    """Return the published bulge and stretch terms that fit `camera` best, by name.

    The terms act on the crop between the corners in pixels and keep its edges in place. Each term
    has a centre of its own: stretch X' = X + a X (X1 - X)(X - X0), then bulge
    X" = X' + b X' (Y1 - Y')(Y' - Y0), and likewise for rows (curvature correction of DarSIA).
    """
    width, height = camera.layout.width, camera.layout.height
    corners = np.array(
        camera._pixels_of([(0, height), (0, 0), (width, 0), (width, height)]), dtype=float
    )
    columns = max(np.linalg.norm(corners[3] - corners[0]), np.linalg.norm(corners[2] - corners[1]))
    rows = max(np.linalg.norm(corners[1] - corners[0]), np.linalg.norm(corners[2] - corners[3]))
    crop = np.array([[0, 0], [0, rows], [columns, rows], [columns, 0]], dtype=float)
    to_crop = np.asarray(
        cv2.getPerspectiveTransform(corners.astype(np.float32), crop.astype(np.float32)), float
    )
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(0, width, 25), np.linspace(0, height, 25)))
    seen = np.stack(_project(to_crop, *camera.to_pixels(x, z)))
    straight_x, straight_y = x * (columns / width), rows - z * (rows / height)

    def misfit(scaled: FloatArray) -> FloatArray:
        hb, vb, hs, vs = scaled[:4] / columns**2
        hbo, vbo, hso, vso = scaled[4:] * columns
        cx, cy = 0.5 * columns, 0.5 * rows
        px = straight_x + hs * (straight_x - cx - hso) * (columns - straight_x) * straight_x
        py = straight_y + vs * (straight_y - cy - vso) * (rows - straight_y) * straight_y
        bent_x = px + hb * (px - cx - hbo) * (rows - py) * py
        bent_y = py + vb * (py - cy - vbo) * (columns - px) * px
        return np.concatenate((bent_x - seen[0], bent_y - seen[1]))

    found = least_squares(misfit, np.full(8, 1e-3)).x
    terms = dict(zip(TERMS, found[:4] / columns**2, strict=True))
    offsets = dict(zip((t + '_offset' for t in TERMS), found[4:] * columns, strict=True))
    return {key: float(f'{value:.6g}') for key, value in {**terms, **offsets}.items()}
