"""What a camera makes of the tracer: effects of the image, grain, noise, blur, clipping."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import Grid, conservative_resample
from porotwin_rig.asset import VirtualRig
from porotwin_rig.effects import Effects

FloatArray = NDArray[np.floating]


def signal_seen(rig: VirtualRig, grid: Grid, *, time: float) -> FloatArray:
    """Return the signal (nz, nx), 0 to 1, that the camera takes from `rig` in the photo of `time`.

    The visible tracer with the image effects among the rig's effects, in this order: response
    (`saturation`), lamps (`illumination`, `reflection`), place (`registration`). No noise.
    """
    effects = rig.effects
    if 'registration' not in effects:
        return _brightness(rig.concentration(grid), grid, effects, time)
    fine = grid.refined(2)
    signal = _brightness(rig.concentration(fine), fine, effects, time)
    return np.clip(conservative_resample(_displaced(signal, fine, effects), grid.shape), 0.0, 1.0)


def _brightness(signal: FloatArray, grid: Grid, effects: Effects, time: float) -> FloatArray:
    if 'saturation' in effects:
        signal = np.clip(signal, 0.0, None) ** effects.number('saturation', 'exponent')
    if 'illumination' in effects:
        drift = effects.number('illumination', 'drift') * time
        gradient = effects.number('illumination', 'gradient')
        signal = signal * (1.0 + drift + gradient * (grid.x - 0.5 * grid.width))[None, :]
    for reflection in effects.all('reflection'):
        height = float(reflection['z']) + float(reflection['climb']) * time
        distance = np.hypot(grid.x[None, :] - float(reflection['x']), grid.z[:, None] - height)
        radius = float(reflection['radius'])
        signal = signal + float(reflection['strength']) * np.exp(-0.5 * (distance / radius) ** 2)
    return np.clip(signal, 0.0, 1.0)


def _displaced(signal: FloatArray, grid: Grid, effects: Effects) -> FloatArray:
    """Return the signal where a point p is seen at C + scale R (p - C) + (dx, dz).

    What lies beyond the rig's edge looks like the edge.
    """
    number = effects.number
    turn, scale = number('registration', 'rotation'), number('registration', 'scale')
    middle_x, middle_z = 0.5 * grid.width, 0.5 * grid.height
    x, z = np.meshgrid(grid.x, grid.z)
    along = (x - middle_x - number('registration', 'dx')) / scale
    up = (z - middle_z - number('registration', 'dz')) / scale
    from_x = middle_x + math.cos(turn) * along + math.sin(turn) * up
    from_z = middle_z - math.sin(turn) * along + math.cos(turn) * up
    return np.asarray(
        cv2.remap(
            signal.astype(np.float32),
            (from_x / grid.dx - 0.5).astype(np.float32),
            (from_z / grid.dz - 0.5).astype(np.float32),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        float,
    )


@dataclass(frozen=True)
class MapNoise:
    """How an image analysis blurs and disturbs a concentration map; standard deviations in c.

    `grain`: fixed pattern of the sand, proportional to the signal; `frame`: new in every frame,
    full on tracer and `background` times that elsewhere; both correlated over `grain_cells` and
    `frame_cells`. `blur_cells`: edges are smoothed by a Gaussian of this deviation. `lost`: share
    of frames that are missing; `patches`: blind spots (NaN) that stay.
    """

    grain: float = 0.025
    grain_cells: float = 0.9
    frame: float = 0.008
    frame_cells: float = 0.8
    blur_cells: float = 0.55
    background: float = 0.6
    lost: float = 0.0
    patches: int = 0

    @classmethod
    def drawn(cls, seed: int) -> 'MapNoise':
        """Return noise of a strength that an ordinary camera has, drawn from `seed`."""
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
    """Turns signals on one grid into maps as an image analysis delivers them.

    Frames may be asked for in any order: each one's noise follows from `seed` and its number.
    """

    def __init__(self, grid: Grid, noise: MapNoise, *, seed: int) -> None:
        self.grid = grid
        self.noise = noise
        self._seed = seed
        generator = np.random.default_rng([seed, 6])
        self._grain = noise.grain * _correlated(generator, grid.shape, noise.grain_cells)
        self._blind = _patches(grid, noise.patches, generator)

    def is_lost(self, number: int) -> bool:
        """Return whether frame `number` never arrived; the first one always does."""
        generator = np.random.default_rng([self._seed, 7, number])
        return number > 0 and bool(generator.random() < self.noise.lost)

    def map(self, signal: FloatArray, number: int) -> FloatArray:
        """Return frame `number` of `signal` (nz, nx) with noise, 0 to 1, NaN in blind spots."""
        generator = np.random.default_rng([self._seed, 8, number])
        blurred = signal
        if self.noise.blur_cells > 0.0:
            blurred = np.asarray(cv2.GaussianBlur(signal, (0, 0), self.noise.blur_cells))
        flicker = self.noise.frame * _correlated(generator, signal.shape, self.noise.frame_cells)
        share = self.noise.background + (1.0 - self.noise.background) * np.clip(blurred, 0.0, 1.0)
        seen = np.clip(blurred * (1.0 + self._grain) + share * flicker, 0.0, 1.0)
        return np.where(self._blind, np.nan, seen)


def _correlated(generator: np.random.Generator, shape: tuple[int, ...], cells: float) -> FloatArray:
    """Return Gaussian noise of unit deviation, correlated over about `cells`."""
    field = generator.standard_normal(shape)
    if cells <= 0.0:
        return field
    smooth = np.asarray(cv2.GaussianBlur(field, (0, 0), cells))
    return smooth / smooth.std()


def _patches(grid: Grid, count: int, generator: np.random.Generator) -> NDArray[np.bool_]:
    blind = np.zeros(grid.shape, dtype=bool)
    for _ in range(count):
        x, z = generator.uniform(0, grid.width), generator.uniform(0, grid.height)
        radius = generator.uniform(0.01, 0.03) * grid.width
        blind |= np.hypot(grid.x[None, :] - x, grid.z[:, None] - z) < radius
    return blind
