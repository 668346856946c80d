"""How straight and how square a projected laser grid becomes when a photograph is rectified.

The red lines of the grid are followed across the rectified picture; in a picture without bulge and
stretch they are straight, stand square on each other, and keep their distances.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_imaging import photograph
from porotwin_imaging.geometry import Geometry

Array = NDArray[Any]

CELL_M = 0.001
"""Cells of the rectified picture [m]."""
BAND_M = 0.03
"""Lines are looked for in bands of this width across them [m]."""
LEAST_BANDS = 0.5
"""Share of the bands in which a line must be seen."""
NEAR_M = 0.012
"""How far a line may move from one band to the next [m]."""


@dataclass(frozen=True)
class GridCheck:
    """Lines found in both directions, and how far they are from a perfect grid.

    `straightness_m`: root mean square distance of the lines from straight ones; `worst_m`: the
    largest of any line, smoothed over bands; `skew_deg`: how far both families are, on average,
    from standing square; `parallel_deg`: spread of the directions within a family; `spacing`:
    relative spread of the distances between neighbouring lines.
    """

    lines: tuple[int, int]
    straightness_m: float
    worst_m: float
    skew_deg: float
    parallel_deg: float
    spacing: float


def check_grid(data: bytes, geometry: Geometry) -> GridCheck:
    """Return how straight and square the red grid in the photograph `data` is in rig metres."""
    pixels = photograph.decode(data).pixels
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
    residuals = [rest for family in families for _, _, rest in family]
    slopes = [np.array([slope for slope, _, _ in family]) for family in families]
    # x = a + slope z for one family, z = a + slope x for the other (rows run down: sign)
    skew = np.degrees(np.median(slopes[0]) + np.median(slopes[1]))
    spread = [np.degrees(np.std(one)) for one in slopes]
    return GridCheck(
        (len(upright), len(level)),
        float(np.sqrt(np.mean(np.concatenate(residuals) ** 2))),
        float(max(np.abs(rest).max() for rest in residuals)),
        float(abs(skew)),
        float(max(spread)),
        max(_spacing(family) for family in families),
    )


def _lines(red: Array) -> list[Array]:
    """Return the lines along the first axis: (n, 2) each, position along and across [m]."""
    height = round(BAND_M / CELL_M)
    bands = red[: red.shape[0] // height * height].reshape(-1, height, red.shape[1])
    profiles = np.median(bands, axis=1)
    profiles -= cv2.blur(profiles, (41, 1))
    smooth = cv2.GaussianBlur(profiles, (0, 0), sigmaX=1.5, sigmaY=1e-3)
    noise = 1.4826 * np.median(np.abs(smooth), axis=1, keepdims=True) + 1e-3
    tracks: list[list[tuple[float, float]]] = []
    for number, (profile, level) in enumerate(zip(smooth, noise[:, 0], strict=True)):
        along = (number + 0.5) * BAND_M
        for peak in _peaks(profile, 4.0 * level):
            near = [t for t in tracks if abs(t[-1][1] - peak) < NEAR_M and t[-1][0] < along]
            if near:
                min(near, key=lambda t: abs(t[-1][1] - peak)).append((along, peak))
            else:
                tracks.append([(along, peak)])
    return [np.array(t) for t in tracks if len(t) >= LEAST_BANDS * len(profiles)]


def _peaks(profile: Array, least: float) -> list[float]:
    """Return the places [m] of the peaks above `least`, to a fraction of a cell."""
    middle = profile[1:-1]
    found = np.flatnonzero((middle > profile[:-2]) & (middle >= profile[2:]) & (middle > least)) + 1
    places = []
    for i in found:
        left, here, right = profile[i - 1 : i + 2]
        places.append((i + 0.5 + 0.5 * (left - right) / (left - 2 * here + right)) * CELL_M)
    return places


def _fits(lines: list[Array]) -> list[tuple[float, float, Array]]:
    """Return (slope, place in the middle, residuals [m]) of a straight fit to each line."""
    fits = []
    for line in lines:
        along, across = line.T
        for _ in range(3):  # a bright grain beside the line is no part of it
            slope, start = np.polyfit(along, across, 1)
            rest = across - start - slope * along
            kept = np.abs(rest) <= max(3 * rest.std(), CELL_M / 2)
            along, across = along[kept], across[kept]
        rest = across - start - slope * along
        smooth = np.convolve(rest, np.ones(3) / 3, mode='valid')
        fits.append((float(slope), float(start + slope * along.mean()), smooth))
    return fits


def _spacing(family: list[tuple[float, float, Array]]) -> float:
    distances = np.diff(np.sort([place for _, place, _ in family]))
    distances = distances[distances < 1.5 * np.median(distances)]
    return float(np.std(distances) / np.mean(distances))
