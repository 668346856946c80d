"""Light references: places in the photographs that never change, such as a frame, tape or the wall.

They take the place of a colour chart. Points are spread evenly over the places, and each takes the
mean light of its surroundings, because prints and scans have a grain. The points of a photograph
are compared with those of the baseline like the patches of a chart: medians tell the light, so that
a covered part has little influence. The scatter of the points tells how well two photographs can be
compared. The limits of light widen by it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.rig import Camera
from porotwin_imaging.geometry.corners_and_lens import apply_homography
from porotwin_imaging.light.colour_checker import ChartLight, chart_light
from porotwin_imaging.numerics.cell_sums import LEAST_LIGHT
from porotwin_imaging.numerics.robust_statistics import SPREAD_PER_DEVIATION
from porotwin_imaging.photograph.linear_light import linear_light

Array = NDArray[Any]

_MOST_POINTS = 300
"""Points over all places: medians over more are no surer."""
_GRAIN_PX = (5, 5)
"""Surroundings of a point [px], wider than the grain of a print."""


@dataclass(frozen=True)
class LightReferences:
    """The places that never change, in the baseline.

    Attributes:
        points: points in them as (column, row) in the decoded baseline, shape (n, 2).
        light: linear red, green and blue around each, shape (n, 3).
    """

    points: Array
    light: Array

    def light_in(self, pixels: NDArray[np.uint8], homography: Array) -> ChartLight | None:
        """Return the light of a photograph beside the baseline; None if no place is seen well.

        `homography` (3, 3) is the alignment of the decoded photograph `pixels` to the baseline.
        """
        columns, rows = apply_homography(homography, *self.points.T)
        seen = (columns >= 0) & (rows >= 0)
        seen &= (columns <= pixels.shape[1] - 1) & (rows <= pixels.shape[0] - 1)
        found = _light_at(pixels, np.stack([columns, rows], axis=1)[seen])
        light = chart_light(found, self.light[seen])
        if light is None:
            return None
        apart = np.log(np.maximum(found, LEAST_LIGHT) / np.maximum(self.light[seen], LEAST_LIGHT))
        scatter = SPREAD_PER_DEVIATION * float(np.median(np.abs(apart - light.log_gain)))
        return ChartLight(
            light.log_gain, 0.0, None, light.log_gain, scatter, 'the places that never change'
        )


def light_references(
    pixels: NDArray[np.uint8], camera: Camera, reduction: int
) -> LightReferences | None:
    """Return the places that never change in a decoded baseline; None if the rig names none.

    `pixels` has shape (rows, columns, 3), blue-green-red, decoded at `reduction`.
    """
    return _of_mask(pixels, inside_references(pixels.shape, camera, reduction))


def surroundings(
    pixels: NDArray[np.uint8], camera: Camera, reduction: int
) -> LightReferences | None:
    """Return points beside the sand in a decoded baseline; None if it shows nothing else.

    They may change. So they can only confirm the light of the sand.
    """
    beside = _filled(pixels.shape, [camera.corners_px], reduction) == 0
    return _of_mask(pixels, cv2.erode(beside.astype(np.uint8), np.ones(_GRAIN_PX)) > 0)


def inside_references(shape: Sequence[int], camera: Camera, reduction: int) -> NDArray[np.bool_]:
    """Return where the decoded baseline of `shape` (rows, columns, ...) never changes."""
    return _filled(shape, camera.references_px, reduction) > 0


def _filled(shape: Sequence[int], places: Sequence[Any], reduction: int) -> NDArray[np.uint8]:
    """Return 1 inside the polygons `places` [px of the file], at the decoded `shape`."""
    inside = np.zeros(tuple(shape[:2]), np.uint8)
    for place in places:
        cv2.fillPoly(inside, [np.rint(np.array(place) / reduction).astype(np.int32)], 1)
    return inside


def _of_mask(pixels: NDArray[np.uint8], inside: NDArray[np.bool_]) -> LightReferences | None:
    """Return points spread evenly over the mask `inside`; None if it is empty."""
    rows, columns = np.nonzero(inside)
    if not len(rows):
        return None
    chosen = np.linspace(0, len(rows) - 1, min(_MOST_POINTS, len(rows))).astype(int)
    points = np.stack([columns, rows], axis=1)[chosen].astype(float)
    return LightReferences(points, _light_at(pixels, points))


def _light_at(pixels: NDArray[np.uint8], points: Array) -> Array:
    """Return the mean linear light around `points` (n, 2), shape (n, 3)."""
    columns, rows = np.rint(points).astype(int).T
    light = cv2.blur(linear_light(pixels), _GRAIN_PX)
    return np.asarray(light[rows, columns], float)
