"""Alignment of a photograph to the baseline: features are tracked and a homography fitted.

A nudged camera or a slightly rotated tripod moves every grain, which would show as tracer. Corners
of the grain texture are tracked from the baseline into the photograph by pyramidal Lucas-Kanade
optical flow. The flow runs on locally normalised brightness, so that tracer and light have no
influence, and each feature is tracked back as a check. A homography is fitted by RANSAC. If the
camera has moved too far for the flow, matched binary features (ORB) give a start value.

Prints and scans of another crop, scale or size are registered first: features of the whole picture
(SIFT) are matched, and the picture is brought to the place of the baseline. That is done for rigs
that name places which never change; of others, another size means another camera.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError


@dataclass(frozen=True)
class AlignmentSettings:
    """Alignment of a photograph to the baseline (`alignment.py`)."""

    widest_px: int = 2000
    """Wider pictures are reduced before features are tracked; tracking costs time per pixel."""
    tracked_points: int = 1200
    """Features over the whole rig: enough even if tracer or a hand spoils many of them."""
    tiles_across: int = 8
    """Features are chosen in 8 x 8 tiles, so that they cover the rig evenly."""
    patch_px: int = 21
    """Side of a tracked patch [px], several grains wide."""
    closure_px: float = 0.3
    """A feature tracked forth and back must return to within this distance [px]. A homography that
    leaves more marks a map as suspicious: the picture is deformed."""
    fewest_inliers: int = 40
    """Matches and inliers below which the photograph does not match; a homography needs four."""
    least_inlier_share: float = 0.35
    """Share of the tracked features that must be inliers [-]; other sand matches only by chance."""
    reported_shift_px: float = 2.0
    """Larger shifts of the camera are mentioned in the status [px of the file]."""


ALIGNMENT = AlignmentSettings()


Array = NDArray[Any]
GreyImage = NDArray[np.uint8]

_FLOW_LEVELS = 4
"""Pyramid levels of the optical flow: shifts of some ten pixels are followed."""
_CORNER_QUALITY, _CORNER_DISTANCE_PX, _CORNER_WINDOW_PX = 0.05, 5, 7
"""Quality relative to the best corner of a tile, distance between corners, and their window."""
_ORB_FEATURES, _ORB_FAST_THRESHOLD = 4000, 10
_CLEARLY_NEARER = 0.8
"""Distance of the best match relative to the second best (Lowe 2004)."""
_NOT_REGISTERED = (
    'photograph does not match the baseline: only {} features of the scene agree; use a print or '
    'scan of the same scene, or take a new baseline'
)
TURNS = {
    'turned by 180 degrees': (slice(None, None, -1), slice(None, None, -1)),
    'mirrored': (slice(None), slice(None, None, -1)),
    'mirrored upside down': (slice(None, None, -1), slice(None)),
}
"""Ways to turn a photograph by software, and the order of rows and columns that undoes them."""
_MIDDLE_GREY, _GREY_PER_SPREAD = 128, 40
"""Normalised brightness in grey levels: three spreads on either side fit into 8 bits."""


@dataclass(frozen=True)
class Alignment:
    """How the camera has moved since the baseline, in pixels of the decoded photograph.

    Attributes:
        homography: from baseline pixels to photograph pixels, shape (3, 3).
        shift: largest displacement of a corner of the rig [px].
        residual: root mean square distance of the inliers from the homography [px].
        inliers: share of the reference features that are inliers [-].
        print_or_scan: whether the picture is one of another size, registered by its scene.
    """

    homography: Array
    shift: float
    residual: float
    inliers: float
    print_or_scan: bool = False


@dataclass(frozen=True)
class ReferenceFeatures:
    """Features of the baseline that are tracked into every photograph.

    Attributes:
        reduction: integer factor between decoded pixels and pixels of the tracking.
        picture: normalised baseline at that scale, shape (rows, columns).
        mask: 1 inside the rig, same shape.
        points: the features as (column, row), float32, shape (n, 1, 2).
        corners: bounding box of the rig as (column, row), float32, shape (4, 1, 2).
        scene: features of the whole picture that register a print or scan: points (n, 2) and
            descriptors (n, 128); None if every photograph is of the same camera.
    """

    reduction: int
    picture: GreyImage
    mask: GreyImage
    points: Array
    corners: Array
    scene: tuple[Array, Array] | None = None


def reference_features(
    pixels: NDArray[np.uint8],
    inside: NDArray[np.bool_],
    unchanging: NDArray[np.bool_] | None = None,
) -> ReferenceFeatures:
    """Return the features of a baseline photograph.

    Args:
        pixels: decoded baseline, shape (rows, columns, 3).
        inside: True inside the rig, shape (rows, columns).
        unchanging: True in places that never change, same shape; None, or nowhere, if every
            photograph is of the same camera.

    Raises:
        InputError: the baseline shows no texture inside the rig.
    """
    reduction = max(1, math.ceil(pixels.shape[1] / ALIGNMENT.widest_px))
    picture = _normalised(_reduced(pixels, reduction))
    mask = _reduced(inside.astype(np.uint8), reduction)
    points = _spread_corners(picture, mask)
    rows, columns = np.nonzero(mask)
    low, high = (columns.min(), rows.min()), (columns.max(), rows.max())
    corners = np.array([[low], [(low[0], high[1])], [high], [(high[0], low[1])]], dtype=np.float32)
    scene = None
    if unchanging is not None and unchanging.any():
        scene = _scene(_reduced(pixels, reduction))
    return ReferenceFeatures(reduction, picture, mask, points, corners, scene)


def align(
    pixels: NDArray[np.uint8],
    reference: ReferenceFeatures,
) -> Alignment:
    """Return how `pixels` is moved against the baseline.

    The shape is that of the baseline, unless the reference has features of the whole scene.

    Raises:
        InputError: the photograph does not show the scene of the baseline.
    """
    reduced = _reduced(pixels, reference.reduction)
    if reference.scene is not None and reduced.shape[:2] != reference.picture.shape:
        return _in_decoded_pixels(_registered(reduced, reference), reference.reduction)
    picture = _normalised(reduced)
    found = _tracked(picture, reference, reference.points)
    start = None
    if found is None:
        start = _matched(picture, reference)
        if start is not None:
            found = _tracked(picture, reference, _moved(reference.points, start))
    if found is None and reference.scene is not None:
        found = _registered(reduced, reference)
    if found is None:
        _refuse_turned(picture, start, reference)
        raise InputError(
            'photograph does not match the baseline: another rig, or the camera has moved too '
            'far; take a new baseline'
        )
    return _in_decoded_pixels(found, reference.reduction)


def _scene(picture: NDArray[np.uint8]) -> tuple[Array, Array] | None:
    """Return points (n, 2) and descriptors (n, 128) of a picture; None if it has too few."""
    points, words = cv2.SIFT.create().detectAndCompute(
        cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), None
    )
    if words is None or len(points) < ALIGNMENT.fewest_inliers:
        return None
    return np.array([point.pt for point in points], np.float32), words


def _registered(picture: NDArray[np.uint8], reference: ReferenceFeatures) -> Alignment:
    """Return the alignment of a print or scan, of another crop and scale, to the baseline.

    Its scene gives a rough place. The grains give the exact one if the print shows them well.

    Raises:
        InputError: the picture does not show the scene.
    """
    own, scene = reference.scene, _scene(picture)
    pairs: list[Any] = []
    if own is not None and scene is not None:
        matches = cv2.BFMatcher().knnMatch(own[1], scene[1], k=2)
        pairs = [one for one, other in matches if one.distance < _CLEARLY_NEARER * other.distance]
    if own is None or scene is None or len(pairs) < ALIGNMENT.fewest_inliers:
        raise InputError(_NOT_REGISTERED.format(len(pairs)))
    source = own[0][[pair.queryIdx for pair in pairs], None]
    target = scene[0][[pair.trainIdx for pair in pairs], None]
    rough, chosen = cv2.findHomography(source, target, cv2.RANSAC)
    if rough is None or chosen.sum() < ALIGNMENT.fewest_inliers:
        raise InputError(_NOT_REGISTERED.format(0 if rough is None else int(chosen.sum())))
    rows, columns = reference.picture.shape
    brought = cv2.warpPerspective(picture, np.linalg.inv(rough), (columns, rows))
    near = _tracked(_normalised(brought.astype(np.uint8)), reference, reference.points)
    if near is not None:
        homography, residual, share = rough @ near.homography, near.residual, near.inliers
    else:
        inlier = chosen[:, 0] == 1
        apart = np.linalg.norm((_moved(source, rough) - target)[inlier, 0], axis=1)
        homography, residual = rough, float(np.sqrt(np.mean(apart**2)))
        share = float(inlier.mean())
    shift = np.linalg.norm(
        (_moved(reference.corners, homography) - reference.corners)[:, 0], axis=1
    )
    return Alignment(homography, float(shift.max()), residual, share, print_or_scan=True)


def _refuse_turned(
    picture: GreyImage,
    start: Array | None,
    reference: ReferenceFeatures,
) -> None:
    """Raise InputError if the picture shows the scene of the baseline turned or mirrored.

    `start` is the rough homography of the picture. Its features match in any direction, but not in
    a mirror.
    """
    mirrored = np.ascontiguousarray(picture[TURNS['mirrored']])
    mirrored_start = None if start is not None else _matched(mirrored, reference)
    likely = {
        'turned by 180 degrees': _is_upside_down(start),
        'mirrored': mirrored_start is not None,
        'mirrored upside down': _is_upside_down(mirrored_start),
    }
    for words in (words for words in TURNS if likely[words]):
        back = np.ascontiguousarray(picture[TURNS[words]])
        near = _matched(back, reference)
        if near is None:
            continue
        if _tracked(back, reference, _moved(reference.points, near)) is not None:
            raise InputError(
                f'photograph is {words} against the baseline; turn it back, or take a baseline '
                'with the same setting of the camera'
            )


def _is_upside_down(homography: Array | None) -> bool:
    """Return whether a homography turns a picture by more than 90 degrees."""
    return homography is not None and homography[0, 0] < 0.0 and homography[1, 1] < 0.0


def alignment_remarks(alignment: Alignment, reduction: int) -> list[str]:
    """Return status lines about a moved camera or a deformed picture.

    `reduction` converts decoded pixels to pixels of the file.
    """
    if alignment.print_or_scan:
        return [
            'print or scan of another size: registered to '
            f'{alignment.residual * reduction:.1f} px; things before the sand are not found'
        ]
    remarks = []
    if alignment.shift * reduction > ALIGNMENT.reported_shift_px:
        remarks.append(f'camera has moved by {alignment.shift * reduction:.1f} px: corrected')
    if alignment.residual > ALIGNMENT.closure_px:
        remarks.append(
            f'alignment leaves {alignment.residual * reduction:.1f} px: the picture is '
            'deformed against the baseline'
        )
    return remarks


def _normalised(pixels: NDArray[np.uint8]) -> GreyImage:
    """Return brightness relative to its local mean and spread, 8-bit grey, (rows, columns)."""
    grey = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY).astype(np.float32)
    side = 3 * ALIGNMENT.patch_px // 2  # wider than a patch
    window = (side, side)
    mean = cv2.blur(grey, window)
    spread = cv2.blur(cv2.absdiff(grey, mean), window)
    scaled = _MIDDLE_GREY + _GREY_PER_SPREAD * (grey - mean) / (spread + 1.0)
    return np.clip(scaled, 0, 255).astype(np.uint8)


def _reduced(picture: Array, reduction: int) -> Array:
    """Return the picture at the scale of the tracking."""
    if reduction == 1:
        return picture
    size = (picture.shape[1] // reduction, picture.shape[0] // reduction)
    cropped = picture[: size[1] * reduction, : size[0] * reduction]
    return cv2.resize(cropped, size, interpolation=cv2.INTER_AREA)


def _in_decoded_pixels(found: Alignment, reduction: int) -> Alignment:
    """Return the alignment in pixels of the decoded photograph instead of the reduced one."""
    k = float(reduction)
    finer = np.array([[k, 0, (k - 1) / 2], [0, k, (k - 1) / 2], [0, 0, 1]])
    return Alignment(
        finer @ found.homography @ np.linalg.inv(finer),
        k * found.shift,
        k * found.residual,
        found.inliers,
        found.print_or_scan,
    )


def _tracked(picture: GreyImage, reference: ReferenceFeatures, guess: Array) -> Alignment | None:
    """Return the alignment by optical flow from the start points `guess`, None if it fails."""
    options: dict[str, Any] = {
        'winSize': (ALIGNMENT.patch_px, ALIGNMENT.patch_px),
        'maxLevel': _FLOW_LEVELS,
        'flags': cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        reference.picture, picture, reference.points, guess.copy(), **options
    )
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(
        picture, reference.picture, there, reference.points.copy(), **options
    )
    closed = np.linalg.norm((back - reference.points)[:, 0], axis=1) < ALIGNMENT.closure_px
    good = closed & (found[:, 0] == 1) & (found_back[:, 0] == 1)
    if good.sum() < ALIGNMENT.fewest_inliers:
        return None
    source, target = reference.points[good], there[good]
    # a feature that returns may be off by the closure on either way
    homography, chosen = cv2.findHomography(source, target, cv2.RANSAC, 2.0 * ALIGNMENT.closure_px)
    if homography is None or chosen is None:
        return None
    inlier = chosen[:, 0] == 1
    if inlier.sum() < ALIGNMENT.fewest_inliers or inlier.mean() < ALIGNMENT.least_inlier_share:
        return None
    residual = np.linalg.norm((_moved(source, homography) - target)[inlier, 0], axis=1)
    moved_corners = _moved(reference.corners, homography)
    shift = np.linalg.norm((moved_corners - reference.corners)[:, 0], axis=1)
    return Alignment(
        homography,
        float(shift.max()),
        float(np.sqrt(np.mean(residual**2))),
        float(inlier.sum() / len(reference.points)),
    )


def _matched(picture: GreyImage, reference: ReferenceFeatures) -> Array | None:
    """Return a rough homography (3, 3) from matched ORB features, None if too few match."""
    detector = cv2.ORB.create(nfeatures=_ORB_FEATURES, fastThreshold=_ORB_FAST_THRESHOLD)
    own_points, own_words = detector.detectAndCompute(reference.picture, reference.mask)
    points, words = detector.detectAndCompute(picture, None)
    if (
        own_words is None
        or words is None
        or min(len(points), len(own_points)) < ALIGNMENT.fewest_inliers
    ):
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(own_words, words)
    if len(matches) < ALIGNMENT.fewest_inliers:
        return None
    source = np.array([own_points[m.queryIdx].pt for m in matches], np.float32)[:, None]
    target = np.array([points[m.trainIdx].pt for m in matches], np.float32)[:, None]
    homography, chosen = cv2.findHomography(source, target, cv2.RANSAC)
    if homography is None or chosen.sum() < ALIGNMENT.fewest_inliers:
        return None
    return homography


def _spread_corners(picture: GreyImage, mask: GreyImage) -> Array:
    """Return the strongest corners of every tile as (column, row), float32, shape (n, 1, 2)."""
    rows, columns = picture.shape
    tiles = ALIGNMENT.tiles_across
    corners_per_tile = ALIGNMENT.tracked_points // (tiles * tiles)
    found: list[Array] = []
    for row in range(tiles):
        for column in range(tiles):
            first_row, first_column = row * rows // tiles, column * columns // tiles
            area = (
                slice(first_row, (row + 1) * rows // tiles),
                slice(first_column, (column + 1) * columns // tiles),
            )
            corners = cv2.goodFeaturesToTrack(
                picture[area],
                corners_per_tile,
                _CORNER_QUALITY,
                _CORNER_DISTANCE_PX,
                mask=mask[area],
                blockSize=_CORNER_WINDOW_PX,
            )
            if corners is not None:
                found.append(np.asarray(corners) + np.array([first_column, first_row], np.float32))
    if not found:
        raise InputError(
            'baseline shows no texture inside the rig: check focus and camera.corners_px'
        )
    return np.concatenate(found).astype(np.float32)


def _moved(points: Array, homography: Array) -> Array:
    """Return points (n, 1, 2) moved by a homography (3, 3), float32."""
    return cv2.perspectiveTransform(
        points.astype(np.float32), homography.astype(np.float64)
    ).astype(np.float32)
