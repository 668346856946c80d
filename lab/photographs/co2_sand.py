"""Photographs of gas and dissolved CO2 in the sand of a real photograph, with known truth.

The pores of the baseline hold water with a pH indicator. CO2 that dissolves changes the colour of
the indicator. Gas drives the water away: the indicator is gone, and dry sand is brighter. In linear
light, for each channel of a pixel with the light I0 of the sand,

    I = I0 exp(-k (1 - s) ((1 - g) a_water + g a_acid) + s b)

with the absorption a of the indicator before and after its change, the state g of the indicator,
the saturation s of gas, the brightening b of dry sand, and the strength k of a colour in front of a
grain: strong in dark sand and between bright grains.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lab.photographs.dyed_sand import TO_LINEAR, Sensor, Shot, at_pixels, photograph_of, places
from porotwin_core.rig import Rig
from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, WATER

Array = NDArray[Any]

INDICATORS = {
    'blue to yellow': ((0.75, 0.40, 0.15), (0.06, 0.14, 0.70)),
    'green to orange': ((0.55, 0.25, 0.50), (0.05, 0.35, 0.80)),
    'purple to yellow': ((0.30, 0.70, 0.25), (0.05, 0.12, 0.60)),
    'yellow to red': ((0.05, 0.15, 0.60), (0.08, 0.60, 0.55)),
}
"""Absorption of red, green and blue by indicators before and after their change [-]."""
_LEAST_LIGHT = 0.002
"""Light is raised to this before a logarithm [-]; it is the noise of the camera."""
_LOCAL_MEAN_PX, _SAND_MEAN_PX = 6.0, 25.0
"""Reach of the means of light over some grains, and over a sand [px]."""
_BY_SAND, _BY_GRAIN = 0.35, 0.5
"""Fall of the strength of a colour with the log of the light of a sand, and of a grain [-]."""
_PLACE_BLUR_PX = 1.2
"""Blur of the edges of fluids by glass and lens [px]."""
_SHAKE_PX, _DRIFT, _SLOPE, _WARMTH = 1.0, 0.02, 0.006, 0.002
"""Standard deviation of the shake of the camera, and amplitudes of the drift of the lamps."""


@dataclass(frozen=True)
class Fluids:
    """The fluids in the pores at one time, over the whole rig, row 0 at the bottom.

    Attributes:
        indicator: state of the indicator: 0 in water, 1 in saturated water, shape (nz, nx).
        gas: saturation of gas [-], same shape.
    """

    indicator: Array
    gas: Array

    @property
    def phases(self) -> NDArray[np.uint8]:
        """The true phase of each cell, by more than half of its colour."""
        dissolved = np.where(self.indicator > 0.5, DISSOLVED, WATER)
        return np.where(self.gas > 0.5, GAS, dissolved).astype(np.uint8)


class Co2Sand:
    """Composes photographs of CO2 on one photograph of sand.

    Args:
        rig: the rig with its true camera, which places the maps on the photograph.
        sand: pixels of the sand, uint8, shape (rows, columns, 3 = blue, green, red).
        indicator: absorption of red, green and blue before and after the change [-].
        dry: brightening of red, green and blue by gas [-].
        sensor: noise and file of the camera.
    """

    def __init__(
        self,
        rig: Rig,
        sand: NDArray[np.uint8],
        indicator: tuple[tuple[float, float, float], tuple[float, float, float]],
        dry: tuple[float, float, float] = (0.30, 0.28, 0.25),
        sensor: Sensor | None = None,
    ) -> None:
        self._light = TO_LINEAR[sand]
        self._strength = _strength(self._light)
        self._water, self._acid = (np.asarray(a, np.float32)[::-1] for a in indicator)
        self._dry = np.asarray(dry, np.float32)[::-1]
        self._sensor = sensor or Sensor()
        self._across, self._up = places(rig, sand.shape[:2])
        inside = (np.abs(self._across - 0.5) < 0.5) & (np.abs(self._up - 0.5) < 0.5)
        self._inside = inside.astype(np.float32)

    def photograph(self, fluids: Fluids, shot: Shot, *, seed: int | tuple[int, ...]) -> bytes:
        """Return a photograph of `fluids` as a JPEG file; `seed` draws the noise."""
        state, gas = (self._shown(part)[..., None] for part in (fluids.indicator, fluids.gas))
        colour = (1.0 - gas) * ((1.0 - state) * self._water + state * self._acid)
        change = self._strength[..., None] * (gas * self._dry - colour)
        light = self._light * np.exp(change * self._inside[..., None])
        return photograph_of(light, shot, self._sensor, seed)

    def _shown(self, field: Array) -> Array:
        """Return a field (nz, nx) over the rig at every pixel."""
        shown = at_pixels(field, self._across, self._up)
        return np.asarray(cv2.GaussianBlur(shown, (0, 0), _PLACE_BLUR_PX))


def _strength(light: Array) -> Array:
    """Return the strength k of colours in front of every pixel, about 1, shape (rows, columns)."""
    logs = np.log(np.maximum(light.mean(axis=2), _LEAST_LIGHT))
    sand = cv2.GaussianBlur(logs, (0, 0), _SAND_MEAN_PX)
    grain = logs - cv2.GaussianBlur(logs, (0, 0), _LOCAL_MEAN_PX)
    strength = np.exp(-_BY_SAND * (sand - np.median(sand)) - _BY_GRAIN * np.clip(grain, -0.7, 0.7))
    return np.asarray(np.clip(strength, 0.3, 2.0), np.float32)


def drawn_fluids(rig: Rig, generator: np.random.Generator, growth: float) -> Fluids:
    """Return one or two plumes of gas, each inside a plume of dissolved CO2 with fingers.

    `growth` is their size relative to the largest, from 0 to 1.
    """
    grid = rig.grid(560, 300)
    x, z = np.meshgrid(grid.x / grid.height, grid.z / grid.height)
    wavy, fine = (_smooth_noise(x.shape, cells, generator) for cells in (24, 7))
    indicator, gas = np.zeros(x.shape), np.zeros(x.shape)
    for _ in range(int(generator.integers(1, 3))):
        x0, z0 = generator.uniform(0.3, x.max() - 0.3), generator.uniform(0.3, 0.55)
        wide, high = generator.uniform(0.3, 0.5), generator.uniform(0.15, 0.25)
        away = np.hypot((x - x0) / wide, (z - z0) / high) / max(growth, 0.05)
        front = generator.uniform(0.03, 0.12)
        plume = 0.5 * (1 - np.tanh((away - 1 - 0.25 * wavy) / front))
        indicator = np.maximum(indicator, plume)
        below_top = 0.5 * (1 - np.tanh((z - z0 - 0.4 * high * growth) / 0.01))
        inner = 0.5 * (1 - np.tanh((away - 0.55 - 0.15 * wavy - 0.05 * fine) / 0.03))
        full = np.clip(0.85 + 0.1 * fine, 0.6, 1.0)
        gas = np.maximum(gas, inner * below_top * full)
    return Fluids(indicator, gas)


def drawn_shot(generator: np.random.Generator) -> Shot:
    """Return the pose and the light of an ordinary photograph."""
    shift = _SHAKE_PX * generator.standard_normal(2)
    slope = _SLOPE * generator.uniform(-1, 1, 2)
    return Shot(
        (float(shift[0]), float(shift[1])),
        gain=1.0 + _DRIFT * float(generator.uniform(-1, 1)),
        slope=(float(slope[0]), float(slope[1])),
        warmth=_WARMTH * float(generator.uniform(-1, 1)),
    )


def phase_overlap(found: Array, truth: Array, phase: int) -> float:
    """Return the intersection over union of a phase in two maps; 1 if neither has it.

    Cells of `found` without a phase do not count.
    """
    known = found <= GAS
    both, either = ((found == phase) & known, (truth == phase) & known)
    union = float((both | either).sum())
    return float((both & either).sum()) / union if union else 1.0


def _smooth_noise(shape: tuple[int, int], cells: int, generator: np.random.Generator) -> Array:
    """Return smooth noise of mean 0 and standard deviation 1, with waves of some `cells`."""
    noise = generator.standard_normal(shape).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), cells)
    return np.asarray((smooth - smooth.mean()) / smooth.std())
