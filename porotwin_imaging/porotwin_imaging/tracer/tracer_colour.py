"""The colour of the tracer, by which tracer and light are told apart.

Tracer absorbs red, green and blue in proportions of its own. A shadow takes the same share of all
of them. A log ratio r = ln(state / baseline) of a cell is therefore split into

    grey    n = mean over the channels of r      light and tracer
    hue     h = r - n                            tracer only

The hue of a cell with tracer points in the direction of the dye, and is `strength` times as large
as its grey darkening. A dye that absorbs all channels alike has no hue and cannot be told from
shadow.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.numerics.robust_statistics import NOISE_SPREADS, SPREAD_PER_DEVIATION

Array = NDArray[Any]
Mask = NDArray[np.bool_]

STRONG_HUE = 0.05
"""Hue or darkening beyond that of noise and light [log ratio], which make up to 0.04. Hues above it
and twice above the noise determine the colour."""
FEWEST_CELLS = 40
"""Cells of a sand, a core, or tracer: their median is known to 1 % while grains scatter by 5 %."""
_LEAST_STRENGTH = 0.1
"""Hue relative to grey darkening below which a dye is as grey as a shadow [-]."""


@dataclass(frozen=True)
class TracerColour:
    """The colour of a tracer.

    Attributes:
        direction: direction of its hue, a unit vector (3,) with the sum 0.
        strength: hue relative to grey darkening [-].
    """

    direction: Array
    strength: float

    @classmethod
    def of_absorbance(cls, absorbance: tuple[float, float, float]) -> 'TracerColour | None':
        """Return the colour of a dye with this absorbance by channel; None if it is grey."""
        darkening = -np.asarray(absorbance, float)
        hue = darkening - darkening.mean()
        size = float(np.linalg.norm(hue))
        strength = size / max(abs(float(darkening.mean())), SMALLEST_DIVISOR)
        return cls(hue / size, strength) if strength >= _LEAST_STRENGTH else None

    def amount(self, hue: Array) -> Array:
        """Return the grey darkening (nz, nx) by tracer that the `hue` (nz, nx, 3) tells."""
        return (hue @ self.direction.astype(hue.dtype)) / self.strength


def split(log_ratio: Array) -> tuple[Array, Array]:
    """Return grey (nz, nx) and hue (nz, nx, 3) of log ratios (nz, nx, 3)."""
    grey = log_ratio.mean(axis=2)
    return grey, log_ratio - grey[..., None]


def local_noise(plane: Array, visible: Mask) -> float:
    """Return the standard deviation of the noise of a smooth plane (nz, nx).

    It is read from the differences between neighbours, which plumes and light hardly change.
    """
    both = visible[:, 1:] & visible[:, :-1]
    if not both.any():
        return 0.0
    steps = np.diff(plane, axis=1)[both]
    return SPREAD_PER_DEVIATION * float(np.median(np.abs(steps))) / np.sqrt(2.0)


def colour_in(log_ratio: Array, visible: Mask) -> TracerColour | None:
    """Return the colour of the tracer in a photograph; None without enough tracer or colour.

    Args:
        log_ratio: log ratio to the baseline without the drift of light, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
    """
    grey, hue = split(log_ratio)
    size = np.linalg.norm(hue, axis=2)
    noise = max(local_noise(hue[..., i], visible) for i in range(3))
    strong = visible & (size > max(2.0 * NOISE_SPREADS * noise, STRONG_HUE)) & (grey < 0)
    strong = cv2.erode(strong.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    if strong.sum() < FEWEST_CELLS:
        return None
    mean = hue[strong].mean(axis=0)
    strength = float(np.median(size[strong] / -grey[strong]))
    if strength < _LEAST_STRENGTH:
        return None
    return TracerColour(mean / np.linalg.norm(mean), strength)
