"""Check of the geometry: is a projected laser grid straight and square in rig coordinates?

The red lines of the grid are tracked across the rectified photograph. Without remaining bulge and
stretch they are straight, perpendicular and equally spaced.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.numerics.robust_statistics import SPREAD_PER_DEVIATION
from porotwin_imaging.photograph.photo_file import decode

Array = NDArray[Any]

CELL_M = 0.001
"""Size of a cell of the rectified picture [m], about one pixel of the camera."""
BAND_M = 0.03
"""Width of the bands across the lines; a line has one peak per band [m]."""
LEAST_BANDS = 0.5
"""Share of the bands that must show a line [-]."""
LARGEST_STEP_M = 0.012
"""Largest displacement of a line from one band to the next [m]."""
_PEAK_SPREADS = 4.0
"""Height of a peak above the noise of its band [spreads]."""
_FIT_ROUNDS = 3
"""Fits of a line; between them points of bright grains beside the line are removed."""


@dataclass(frozen=True)
class LaserGridCheck:
    """Deviations of the rectified laser grid from a perfect one.

    Attributes:
        lines: number of upright and of level lines that were found.
        straightness_m: root mean square distance of the lines from straight lines [m].
        worst_m: largest distance of any line, smoothed over three bands [m].
        skew_deg: deviation of both families from a right angle [degrees].
        parallel_deg: spread of the directions within a family [degrees].
        spacing: relative spread of the distances between neighbouring lines [-].
    """

    lines: tuple[int, int]
    straightness_m: float
    worst_m: float
    skew_deg: float
    parallel_deg: float
    spacing: float


def check_laser_grid(data: bytes, geometry: Geometry) -> LaserGridCheck:
    """Return the deviations of the red grid in the photograph `data` (bytes of the file).

    Raises:
        InputError: the photograph cannot be used.
    """
    pixels = decode(data).pixels
    nx, nz = round(geometry.width / CELL_M), round(geometry.height / CELL_M)
    x, z = np.meshgrid((np.arange(nx) + 0.5) * CELL_M, (np.arange(nz)[::-1] + 0.5) * CELL_M)
    columns, rows = geometry.to_pixels(x, z)
    rectified = cv2.remap(
        pixels, columns.astype(np.float32), rows.astype(np.float32), cv2.INTER_LINEAR
    ).astype(np.float32)
    red = rectified[..., 2] - 0.5 * (rectified[..., 0] + rectified[..., 1])
    upright = _lines(red)
    level = _lines(red.T)
    families = [_fits(lines) for lines in (upright, level)]
    residuals = [residual for family in families for _, _, residual in family]
    slopes = [np.array([slope for slope, _, _ in family]) for family in families]
    # x = a + slope z in one family and z = a + slope x in the other; rows count downwards
    skew = np.degrees(np.median(slopes[0]) + np.median(slopes[1]))
    spread = [np.degrees(np.std(one)) for one in slopes]
    return LaserGridCheck(
        (len(upright), len(level)),
        float(np.sqrt(np.mean(np.concatenate(residuals) ** 2))),
        float(max(np.abs(residual).max() for residual in residuals)),
        float(abs(skew)),
        float(max(spread)),
        max(_spacing(family) for family in families),
    )


def _lines(red: Array) -> list[Array]:
    """Return the lines along the first axis: arrays (n, 2) of positions along and across [m]."""
    height = round(BAND_M / CELL_M)
    bands = red[: red.shape[0] // height * height].reshape(-1, height, red.shape[1])
    profiles = np.median(bands, axis=1)
    profiles -= cv2.blur(profiles, (41, 1))
    smooth = cv2.GaussianBlur(profiles, (0, 0), sigmaX=1.5, sigmaY=1e-3)
    noise = SPREAD_PER_DEVIATION * np.median(np.abs(smooth), axis=1, keepdims=True) + 1e-3
    tracks: list[list[tuple[float, float]]] = []
    for number, (profile, level) in enumerate(zip(smooth, noise[:, 0], strict=True)):
        along = (number + 0.5) * BAND_M
        for peak in _peaks(profile, _PEAK_SPREADS * level):
            near = [t for t in tracks if abs(t[-1][1] - peak) < LARGEST_STEP_M and t[-1][0] < along]
            if near:
                min(near, key=lambda t: abs(t[-1][1] - peak)).append((along, peak))
            else:
                tracks.append([(along, peak)])
    return [np.array(t) for t in tracks if len(t) >= LEAST_BANDS * len(profiles)]


def _peaks(profile: Array, least: float) -> list[float]:
    """Return the positions [m] of the peaks above `least`, interpolated between cells."""
    middle = profile[1:-1]
    found = np.flatnonzero((middle > profile[:-2]) & (middle >= profile[2:]) & (middle > least)) + 1
    places = []
    for i in found:
        before, here, after = profile[i - 1 : i + 2]
        places.append((i + 0.5 + 0.5 * (before - after) / (before - 2 * here + after)) * CELL_M)
    return places


def _fits(lines: list[Array]) -> list[tuple[float, float, Array]]:
    """Return (slope, position in the middle, residuals [m]) of a straight fit to each line."""
    fits = []
    for line in lines:
        along, across = line.T
        for _ in range(_FIT_ROUNDS):
            slope, start = np.polyfit(along, across, 1)
            residual = across - start - slope * along
            kept = np.abs(residual) <= max(3 * residual.std(), CELL_M / 2)
            along, across = along[kept], across[kept]
        residual = across - start - slope * along
        smooth = np.convolve(residual, np.ones(3) / 3, mode='valid')
        fits.append((float(slope), float(start + slope * along.mean()), smooth))
    return fits


def _spacing(family: list[tuple[float, float, Array]]) -> float:
    """Return the relative spread of the distances, without gaps where a line is missing."""
    distances = np.diff(np.sort([place for _, place, _ in family]))
    distances = distances[distances < 1.5 * np.median(distances)]
    return float(np.std(distances) / np.mean(distances))
