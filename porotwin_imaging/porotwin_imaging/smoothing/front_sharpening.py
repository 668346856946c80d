"""Sharpening of fronts: lens, glass, JPEG and remapping blur a photograph by a known width.

A photograph shows the tracer c blurred, v = G c, with a Gaussian G of known width. Where cells are
about as small as the blur, v is too high in front of a front and too low behind it. Two steps of
Van Cittert's iteration (Jansson, Deconvolution of Images and Spectra, 1997) take most of it back:

    u = v + (v - G v),    then    w = u + (v - G u)

They multiply no wave by more than 3. Each value stays between the least and the largest v of its
cell and the eight neighbours, so that no front overshoots and plateaus keep their height. The steps
come after the denoising, which hardly widens fronts, so that little noise is amplified.

The cells are coarser than the blur. A Gaussian between cells with the variance of the blur is right
for wide fronts only: from a front as sharp as the blur it takes two thirds of what the camera does.
G is therefore the discrete Gaussian that does the same to such a front, at any place in a cell.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ive

from porotwin_imaging.numerics.robust_statistics import FEW_ROUNDS, NOISE_SPREADS
from porotwin_imaging.numerics.row_bands import by_overlapping_bands
from porotwin_imaging.smoothing.level_smoothing import SmoothedMap


@dataclass(frozen=True)
class SharpeningSettings:
    """Taking the blur of the camera back (`front_sharpening.py`)."""

    blur_px: float = 0.7
    """Standard deviation of the blur of tracer in a photograph whose fronts were not compared with
    a model [px of the file]: JPEG and demosaicing alone. Fronts on composed photographs tell 1.2 to
    2.8 px. Taking too much back invents steep fronts, and costs more than taking too little."""


SHARPENING = SharpeningSettings()


Array = NDArray[Any]

_REMAPPING_PX = math.sqrt(1 / 6)
"""Blur of linear interpolation [decoded px]: a (1 - a) in squares, the mean over all places a."""
_STEPS = 2
"""Steps of the iteration; more change little."""
_FREQUENCIES = 64
"""Frequencies up to the finest wave that cells show, over which the gain of noise is averaged."""
_FINER = 10
"""Finest wave of a front, relative to the finest one that cells show."""
_SHARPEST = 0.02
"""Blurs below this count as this [cells]; they change nothing."""
_NEIGHBOURS = np.ones((3, 3), np.uint8)


def blur_in_cells(
    pixels_per_cell: tuple[float, float],
    reduction: int,
    blur_px: float = SHARPENING.blur_px,
) -> tuple[float, float]:
    """Return the standard deviation of the blur of a photograph, up and across [cells].

    Args:
        pixels_per_cell: height and width of a cell [px of the decoded photograph].
        reduction: ratio of pixels of the file to decoded pixels.
        blur_px: standard deviation of the blur of tracer in a photograph [px of the file].
    """
    width = math.hypot(blur_px / reduction, _REMAPPING_PX)
    up, across = pixels_per_cell
    return width / up, width / across


def sharpened(smoothed: SmoothedMap, blur: tuple[float, float]) -> SmoothedMap:
    """Return the map without the blur of the camera.

    The noise is multiplied as if it were independent in every cell; smooth noise grows less.

    Args:
        smoothed: the denoised map.
        blur: standard deviation of the blur, up and across [cells].
    """
    up, across = (_kernel(width) for width in blur)

    def band(values: Array) -> tuple[Array]:
        known = np.isfinite(values)
        filled = np.where(known, values, np.float32(0.0))
        # a hidden neighbour counts as equal to the cell
        hidden = 1.0 - _blurred(known.astype(np.float32), up, across)
        least = cv2.erode(np.where(known, values, np.float32(np.inf)), _NEIGHBOURS)
        largest = cv2.dilate(np.where(known, values, np.float32(-np.inf)), _NEIGHBOURS)
        sharp = filled
        for _ in range(_STEPS):
            again = _blurred(sharp, up, across) + hidden * sharp
            limited = np.clip(sharp + (filled - again), least, largest)
            sharp = np.where(known, limited, np.float32(0.0))
        return (np.where(known, sharp, np.float32(np.nan)),)

    reach = _STEPS * (up.size // 2)
    (sharp,) = by_overlapping_bands(band, reach, smoothed.values.astype(np.float32))
    return SmoothedMap(sharp, smoothed.noise * _noise_factor(up, across))


def _blurred(values: Array, up: Array, across: Array) -> Array:
    """Return `values` (nz, nx) blurred by the kernels."""
    return np.asarray(cv2.sepFilter2D(values, -1, across, up, borderType=cv2.BORDER_REPLICATE))


def _kernel(width: float) -> Array:
    """Return the discrete Gaussian that acts on cells as the blur `width` [cells], shape (odd,).

    Its variance is exact for small widths too (Lindeberg, IEEE Trans. PAMI 12:234, 1990).
    """
    variance = _variance_between_cells(max(width, _SHARPEST))
    reach = max(1, math.ceil(NOISE_SPREADS * math.sqrt(variance)))
    weights = ive(np.arange(-reach, reach + 1), variance)
    return np.asarray(weights / weights.sum(), np.float32)


def _variance_between_cells(width: float) -> float:
    """Return the variance of the discrete Gaussian [cells^2] for a blur of `width` [cells].

    It does to cell means of a front of this width what the blur does, by least squares over all
    places of the front in a cell. The waves of the front beyond the finest one of the cells count
    with the wave that cells take them for.
    """
    waves = (np.arange(_FINER * _FREQUENCIES) + 0.5) * np.pi / _FREQUENCIES
    front = (np.sinc(waves / (2 * np.pi)) * np.exp(-0.5 * (width * waves) ** 2) / waves) ** 2
    lost = 1.0 - np.exp(-0.5 * (width * waves) ** 2)
    variance = width**2
    for _ in range(FEW_ROUNDS):
        between = -np.expm1(variance * (np.cos(waves) - 1.0))
        variance *= float(front @ (lost * between) / (front @ between**2))
    return variance


def _noise_factor(up: Array, across: Array) -> float:
    """Return the standard deviation of sharpened white noise, relative to that before."""
    lost = 1.0 - np.outer(_transfer(up), _transfer(across))
    gain = sum(lost**power for power in range(_STEPS + 1))
    return float(np.sqrt(np.mean(gain**2)))


def _transfer(kernel: Array) -> Array:
    """Return the factor of a symmetric kernel on waves of evenly spaced frequencies."""
    middle = kernel.size // 2
    waves = np.linspace(0.0, np.pi, _FREQUENCIES)
    places = np.arange(1, middle + 1)
    return np.asarray(kernel[middle] + 2.0 * np.cos(np.outer(waves, places)) @ kernel[middle + 1 :])
