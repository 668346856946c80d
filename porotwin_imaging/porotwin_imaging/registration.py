"""Alignment of a photograph to the baseline: features followed, a robust homography through them.

A nudged camera, a slow drift or a slightly turned tripod moves every grain; unless it is undone it
shows as tracer. Corners of the baseline's texture are followed into the photograph by pyramidal
Lucas-Kanade flow on locally normalised brightness (so that tracer and light do not pull), checked
by following them back, and a homography is fitted by RANSAC; where the flow fails because the
camera moved far, binary features (ORB) are matched instead to give it a start.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError

Array = NDArray[Any]
GreyImage = NDArray[np.uint8]

WIDEST = 2000
"""Pictures wider than this are followed at a coarser scale."""
TRACKED_POINTS = 1200
PATCH = 21
"""Side of the tracked patches [decoded px]."""
RANSAC_TOLERANCE = 0.6
"""Distance from the homography up to which a tracked point counts as following it [px]."""
MINIMUM_INLIERS = 40
MINIMUM_SHARE = 0.35


@dataclass(frozen=True)
class Alignment:
    """`homography` (3, 3) from baseline to photograph pixels, and how well it explains the picture.

    Pixels are those of the decoded photograph. `shift`: largest displacement at the region's
    corners [px]; `residual`: root mean square distance of the inliers [px]; `inliers`: their share.
    """

    homography: Array
    shift: float
    residual: float
    inliers: float


def normalised(pixels: NDArray[np.uint8]) -> GreyImage:
    """Return brightness relative to its local mean and spread, as 8-bit grey (rows, columns)."""
    grey = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY).astype(np.float32)
    scale = 31
    mean = cv2.blur(grey, (scale, scale))
    spread = cv2.blur(cv2.absdiff(grey, mean), (scale, scale))
    return np.clip(128 + 40 * (grey - mean) / (spread + 1.0), 0, 255).astype(np.uint8)


class Aligner:
    """Follows the texture of a baseline, given as `pixels` (rows, columns, 3), inside `region`."""

    def __init__(self, pixels: NDArray[np.uint8], region: NDArray[np.bool_]) -> None:
        self._factor = max(1, math.ceil(pixels.shape[1] / WIDEST))
        self._baseline = normalised(self._coarser(pixels))
        mask = self._coarser(region.astype(np.uint8))
        self._points = _spread_corners(self._baseline, mask)
        self._orb_mask = mask
        rows, columns = np.nonzero(mask)
        low, high = (columns.min(), rows.min()), (columns.max(), rows.max())
        self._corners = np.array(
            [[low], [(low[0], high[1])], [high], [(high[0], low[1])]], dtype=np.float32
        )

    def align(self, pixels: NDArray[np.uint8]) -> Alignment:
        """Return how `pixels`, of the same shape as the baseline, is moved against it.

        Raises:
            InputError: the photograph does not show the baseline's scene.
        """
        picture = normalised(self._coarser(pixels))
        found = self._follow(picture, self._points)
        if found is None:
            start = self._match(picture)
            found = None if start is None else self._follow(picture, _moved(self._points, start))
        if found is None:
            raise InputError(
                'photograph does not match the baseline: another rig, or the camera has moved too '
                'far; take a new baseline'
            )
        return self._in_pixels(found)

    def _coarser(self, picture: Array) -> Array:
        """Return the picture at the scale that features are followed on."""
        if self._factor == 1:
            return picture
        size = (picture.shape[1] // self._factor, picture.shape[0] // self._factor)
        cropped = picture[: size[1] * self._factor, : size[0] * self._factor]
        return cv2.resize(cropped, size, interpolation=cv2.INTER_AREA)

    def _in_pixels(self, found: Alignment) -> Alignment:
        """Return the alignment in the decoded photograph's own pixels."""
        k = float(self._factor)
        finer = np.array([[k, 0, (k - 1) / 2], [0, k, (k - 1) / 2], [0, 0, 1]])
        return Alignment(
            finer @ found.homography @ np.linalg.inv(finer),
            k * found.shift,
            k * found.residual,
            found.inliers,
        )

    def _follow(self, picture: GreyImage, guess: Array) -> Alignment | None:
        options: dict[str, Any] = {
            'winSize': (PATCH, PATCH),
            'maxLevel': 4,
            'criteria': (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.005),
            'flags': cv2.OPTFLOW_USE_INITIAL_FLOW,
        }
        there, seen, _ = cv2.calcOpticalFlowPyrLK(
            self._baseline, picture, self._points, guess.copy(), **options
        )
        back, seen_back, _ = cv2.calcOpticalFlowPyrLK(
            picture, self._baseline, there, self._points.copy(), **options
        )
        closed = np.linalg.norm((back - self._points)[:, 0], axis=1) < 0.3
        good = closed & (seen[:, 0] == 1) & (seen_back[:, 0] == 1)
        if good.sum() < MINIMUM_INLIERS:
            return None
        source, target = self._points[good], there[good]
        homography, chosen = cv2.findHomography(
            source, target, cv2.RANSAC, RANSAC_TOLERANCE, maxIters=2000, confidence=0.999
        )
        if homography is None or chosen is None:
            return None
        chosen = chosen[:, 0] == 1
        share = chosen.sum() / len(self._points)
        if chosen.sum() < MINIMUM_INLIERS or chosen.mean() < MINIMUM_SHARE:
            return None
        residual = np.linalg.norm((_moved(source, homography) - target)[chosen, 0], axis=1)
        shift = np.linalg.norm((_moved(self._corners, homography) - self._corners)[:, 0], axis=1)
        return Alignment(
            homography, float(shift.max()), float(np.sqrt(np.mean(residual**2))), float(share)
        )

    def _match(self, picture: GreyImage) -> Array | None:
        detector = cv2.ORB.create(nfeatures=4000, fastThreshold=10)
        baseline_points, baseline_words = detector.detectAndCompute(self._baseline, self._orb_mask)
        points, words = detector.detectAndCompute(picture, None)
        if baseline_words is None or words is None or min(len(points), len(baseline_points)) < 20:
            return None
        matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
        matches = matcher.match(baseline_words, words)
        if len(matches) < 20:
            return None
        source = np.array([baseline_points[m.queryIdx].pt for m in matches], np.float32)[:, None]
        target = np.array([points[m.trainIdx].pt for m in matches], np.float32)[:, None]
        homography, chosen = cv2.findHomography(source, target, cv2.RANSAC, 4.0, maxIters=5000)
        if homography is None or chosen.sum() < 20:
            return None
        return homography


def _spread_corners(picture: GreyImage, mask: GreyImage) -> Array:
    """Return the best corners of every tile of the picture, shape (n, 1, 2), spread evenly."""
    rows, columns = picture.shape
    tiles = 8
    each = TRACKED_POINTS // (tiles * tiles)
    found: list[Array] = []
    for row in range(tiles):
        for column in range(tiles):
            top, left = row * rows // tiles, column * columns // tiles
            area = (
                slice(top, (row + 1) * rows // tiles),
                slice(left, (column + 1) * columns // tiles),
            )
            corners = cv2.goodFeaturesToTrack(
                picture[area], each, 0.05, 5, mask=mask[area], blockSize=7
            )
            if corners is not None:
                found.append(np.asarray(corners) + np.array([left, top], np.float32))
    if not found:
        raise InputError(
            'baseline shows no texture inside the rig: check focus and camera.corners_px'
        )
    return np.concatenate(found).astype(np.float32)


def _moved(points: Array, homography: Array) -> Array:
    return cv2.perspectiveTransform(
        points.astype(np.float32), homography.astype(np.float64)
    ).astype(np.float32)
