"""Concentration maps like those from photographs, with grain, noise, blur and lost frames."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid

FloatArray = NDArray[np.floating]


@dataclass(frozen=True)
class MapNoise:
    """Blur and noise of a concentration map from photographs.

    Args:
        grain: standard deviation of the fixed pattern of the sand, relative to the signal.
        grain_cells: correlation length of the grain [cells].
        frame: standard deviation of the noise that is new in every frame, on full tracer.
        frame_cells: correlation length of that noise [cells].
        blur_cells: standard deviation of the Gaussian that smooths edges [cells].
        background: noise of a frame without tracer, relative to that on full tracer.
    """

    grain: float = 0.025
    grain_cells: float = 0.9
    frame: float = 0.008
    frame_cells: float = 0.8
    blur_cells: float = 0.55
    background: float = 0.6

    @classmethod
    def drawn(cls, seed: int) -> 'MapNoise':
        """Return noise of random strength in the range of ordinary cameras."""
        generator = np.random.default_rng([seed, 5])
        return cls(
            grain=float(generator.uniform(0.015, 0.035)),
            grain_cells=float(generator.uniform(0.6, 1.2)),
            frame=float(generator.uniform(0.004, 0.012)),
            frame_cells=float(generator.uniform(0.6, 1.0)),
            blur_cells=float(generator.uniform(0.4, 0.8)),
            background=float(generator.uniform(0.3, 1.0)),
        )


class MapCamera:
    """Turns signals into maps like those from photographs.

    The noise of a frame depends only on `seed` and the number of the frame, so frames may be made
    in any order.

    Args:
        grid: grid of signals and maps.
        noise: strength of blur and noise.
        seed: seed of all noise.
    """

    def __init__(self, grid: Grid, noise: MapNoise, *, seed: int) -> None:
        self.grid = grid
        self.noise = noise
        self._seed = seed
        generator = np.random.default_rng([seed, 6])
        self._grain = noise.grain * _correlated(generator, grid.shape, noise.grain_cells)

    def map(self, signal: FloatArray, number: int) -> FloatArray:
        """Return frame `number` of `signal` (nz, nx) with noise: 0 to 1."""
        generator = np.random.default_rng([self._seed, 8, number])
        blurred = signal
        if self.noise.blur_cells > 0.0:
            blurred = np.asarray(
                cv2.GaussianBlur(
                    signal, (0, 0), self.noise.blur_cells, borderType=cv2.BORDER_REFLECT
                )
            )
        flicker = self.noise.frame * _correlated(generator, signal.shape, self.noise.frame_cells)
        share = self.noise.background + (1.0 - self.noise.background) * np.clip(blurred, 0.0, 1.0)
        return np.clip(blurred * (1.0 + self._grain) + share * flicker, 0.0, 1.0)


def _correlated(generator: np.random.Generator, shape: tuple[int, ...], cells: float) -> FloatArray:
    """Return Gaussian noise of standard deviation 1, correlated over about `cells`."""
    field = generator.standard_normal(shape)
    if cells <= 0.0:
        return field
    smooth = np.asarray(cv2.GaussianBlur(field, (0, 0), cells))
    return smooth / smooth.std()
