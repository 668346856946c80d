"""Photographs of tracer in the sand of a real baseline photograph, composed with known truth.

Tracer absorbs light in the pores. In linear light, for each channel of a pixel,

    I = I0 exp(-(k(sand) - k_grain ln(I0 / local mean of I0)) g(c))

with g the response of the dye, g(0) = 0 and g(1) = 1, and k the absorption of stock in a sand.
Grains that are brighter than their surroundings have less tracer in front of them. The camera then
shakes, lamps drift, the sensor is noisy, and the file is a JPEG. Grains, sands, lamps and the
colour chart are those of the baseline.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_imaging.geometry.corners_and_lens import Geometry

Array = NDArray[Any]
Labels = NDArray[np.uint8]
Linear = NDArray[np.float32]
"""Linear light of a picture, 0 to 1, shape (rows, columns, 3 = blue, green, red) as OpenCV has."""
Obstacle = Callable[[Linear], Linear]
"""Changes the light of the finished scene: a hand, a shadow, a reflection."""
Family = Literal['exponential', 'saturating', 'power']

_LEAST_LIGHT = 0.002
"""Light is raised to this before a logarithm [-]; it is the noise of the camera."""
_LOCAL_MEAN_PX = 6.0
"""Reach of the local mean of light [px]: some grains."""
_GRAIN_LIMIT = 0.7
"""Grains deviate from the local mean by at most this [log]; more is an object."""
_TRACER_BLUR_PX = 1.2
"""Blur of the edge of the tracer by glass and lens [px]."""
_WATER_TEXTURE, _WATER_REACH_PX = 0.4, 9.0
"""Water above the sand: texture relative to the median of the picture, and the window of it."""
_MOST_SANDS = 8
"""Permeabilities that count as sands of their own."""
_FILE_LEVELS = np.arange(256) / 255.0
TO_LINEAR = np.where(
    _FILE_LEVELS <= 0.04045, _FILE_LEVELS / 12.92, ((_FILE_LEVELS + 0.055) / 1.055) ** 2.4
).astype(np.float32)
"""Linear light of each grey level, by the curve of sRGB."""
_CODES = 4096
"""Entries of the inverse curve: finer than a grey level in the darkest parts."""
_LINEAR = np.linspace(0.0, 1.0, _CODES)
_TO_LEVEL = 255.0 * np.where(
    _LINEAR <= 0.0031308, 12.92 * _LINEAR, 1.055 * _LINEAR ** (1 / 2.4) - 0.055
).astype(np.float32)


@dataclass(frozen=True)
class DyeResponse:
    """The response g of a dye; all families are 0 at 0, 1 at stock and monotone.

        exponential  g = (1 - exp(-b c)) / (1 - exp(-b))   concave for b > 0, linear at 0
        saturating   g = (1 + b) c / (1 + b c)             concave for b > 0, convex for -1 < b < 0
        power        g = c^b                               concave for b < 1

    Attributes:
        family: name of the formula.
        bend: b of the formula [-].
    """

    family: Family = 'exponential'
    bend: float = 0.3

    def __call__(self, concentration: Array) -> Array:
        """Return g of `concentration`, of the same shape."""
        c, b = concentration, self.bend
        if self.family == 'power':
            return np.asarray(np.clip(c, 0, None) ** b)
        if self.family == 'saturating':
            return (1 + b) * c / (1 + b * c)
        return c if b == 0 else np.expm1(-b * c) / math.expm1(-b)


@dataclass(frozen=True)
class Dye:
    """A dye in front of the sands of a rig.

    Attributes:
        absorption: k of tracer stock [-], shape (sands, 3 = red, green, blue).
        grain: k_grain of red, green and blue [-].
        response: g, from concentration to absorbance relative to stock.
    """

    absorption: Array
    grain: tuple[float, float, float] = (0.67, 0.36, 0.63)
    response: DyeResponse = field(default_factory=DyeResponse)


@dataclass(frozen=True)
class Shot:
    """The pose of the camera and the light of one photograph, relative to the baseline.

    Attributes:
        shift: displacement of the picture to the right and down [px].
        rotation: rotation of the picture about its middle, counter-clockwise [degree].
        gain: brightness of the lamps [-].
        slope: change of brightness across and down the whole picture [-].
        warmth: red and blue gain and lose this much [-].
    """

    shift: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    gain: float = 1.0
    slope: tuple[float, float] = (0.0, 0.0)
    warmth: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """The sensor of the camera and its file.

    Attributes:
        read: standard deviation of its noise in the dark, linear light [-].
        shot: variance of its noise relative to light [-].
        quality: JPEG quality, 0 to 100.
    """

    read: float = 0.001
    shot: float = 3.5e-5
    quality: int = 92


class DyedSand:
    """Composes photographs of tracer on one baseline.

    Args:
        rig: the rig with its true camera, which places the maps on the baseline.
        baseline: pixels of the baseline, uint8, shape (rows, columns, 3 = blue, green, red).
        sands: index of the sand of every pixel, uint8, shape (rows, columns); see `sands_of`.
        dye: the dye; its rows of absorption are those of `sands`.
        sensor: noise and file of the camera.
    """

    def __init__(
        self,
        rig: Rig,
        baseline: NDArray[np.uint8],
        sands: Labels,
        dye: Dye,
        sensor: Sensor | None = None,
    ) -> None:
        if sands.shape != baseline.shape[:2]:
            raise InputError(f'sands {sands.shape} do not fit the baseline {baseline.shape[:2]}')
        if int(sands.max()) >= len(dye.absorption):
            raise InputError(f'{int(sands.max()) + 1} sands; the dye knows {len(dye.absorption)}')
        self._dye = dye
        self._sensor = sensor or Sensor()
        self._light = TO_LINEAR[baseline]
        self._absorption = _absorption(self._light, sands, dye)
        self._across, self._up = places(rig, baseline.shape[:2])

    def photograph(
        self,
        concentration: Array,
        shot: Shot,
        *,
        seed: int | tuple[int, ...],
        obstacle: Obstacle | None = None,
    ) -> bytes:
        """Return a photograph of `concentration` as a JPEG file.

        Args:
            concentration: map of tracer [-], shape (nz, nx), over the whole rig.
            shot: pose of the camera and light.
            seed: seed of the noise.
            obstacle: changes the light of the scene.

        Raises:
            InputError: the map contains NaN.
        """
        if not np.isfinite(concentration).all():
            raise InputError('concentration: give a map without NaN')
        light = self._light * np.exp(-self._absorption * self._seen(concentration)[..., None])
        if obstacle is not None:
            light = obstacle(light)
        return photograph_of(light, shot, self._sensor, seed)

    def _seen(self, concentration: Array) -> Linear:
        """Return g of the tracer at every pixel; tracer outside the rig is not seen."""
        tracer = at_pixels(concentration, self._across, self._up)
        outside = (np.abs(self._across - 0.5) > 0.5) | (np.abs(self._up - 0.5) > 0.5)
        tracer[outside] = 0.0
        blurred = cv2.GaussianBlur(tracer, (0, 0), _TRACER_BLUR_PX)
        return np.asarray(self._dye.response(np.clip(blurred, 0.0, 1.0)), np.float32)


def photograph_of(light: Linear, shot: Shot, sensor: Sensor, seed: int | tuple[int, ...]) -> bytes:
    """Return the JPEG file of a scene in the pose and light of `shot`; `seed` is of the noise."""
    light = _moved(light, shot) * _lamps(shot, light.shape[:2])
    noise = np.random.default_rng(seed).standard_normal(light.shape, dtype=np.float32)
    spread = np.sqrt(sensor.read**2 + sensor.shot * np.maximum(light, 0.0))
    noisy = np.clip(light + noise * spread.astype(np.float32), 0.0, 1.0)
    levels = _TO_LEVEL[(noisy * np.float32(_CODES - 1)).astype(np.int32)]
    pixels = np.clip(levels + 0.5, 0, 255).astype(np.uint8)
    whole, data = cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, sensor.quality])
    if not whole:
        raise RuntimeError('JPEG encoder failed')
    return data.tobytes()


def places(rig: Rig, shape: tuple[int, int]) -> tuple[Linear, Linear]:
    """Return where each pixel shows the rig: right and up, 0 to 1, each of `shape`."""
    row, column = np.indices(shape, np.float32)
    x, z = Geometry.of(rig).to_metres(column, row)
    return (x / rig.width_m).astype(np.float32), (z / rig.height_m).astype(np.float32)


def at_pixels(field: Array, across: Linear, up: Linear) -> Linear:
    """Return a field (nz, nx) over the whole rig at the `places` of pixels, shape of `across`.

    It is linear between the centres of cells. Beyond the rig it has the values of the edge.
    """
    rows, columns = field.shape
    return np.asarray(
        cv2.remap(
            np.ascontiguousarray(field, np.float32),
            across * columns - np.float32(0.5),
            up * rows - np.float32(0.5),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def sands_of(rig: Rig, baseline: NDArray[np.uint8]) -> Labels:
    """Return the index of the sand of every pixel, 0 for water and the frame.

    A sand is a level of the permeability of the rig. Its edge is smooth between the cells.
    The smooth part of the picture at its top is water.
    """
    permeability = np.log(np.atleast_2d(rig.nominal_map('permeability_m2')))
    levels = np.unique(permeability.round(3))
    if len(levels) > _MOST_SANDS:
        levels = np.unique(np.quantile(permeability, np.linspace(0, 1, _MOST_SANDS)))
    kind = np.abs(permeability[..., None] - levels).argmin(axis=-1)
    across, up = places(rig, baseline.shape[:2])
    best, labels = np.full(baseline.shape[:2], -1.0, np.float32), np.zeros(across.shape, np.uint8)
    for number in range(len(levels)):
        share = at_pixels(kind == number, across, up)
        nearer = share > best
        labels[nearer], best[nearer] = number + 1, share[nearer]
    labels[_water(baseline) | (np.abs(across - 0.5) > 0.5) | (np.abs(up - 0.5) > 0.5)] = 0
    return labels


def _water(baseline: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return the smooth part at the top of the picture, shape (rows, columns)."""
    light = np.log(np.maximum(TO_LINEAR[baseline].mean(axis=2), _LEAST_LIGHT))
    grains = np.abs(light - cv2.GaussianBlur(light, (0, 0), 2.0))
    texture = cv2.GaussianBlur(grains, (0, 0), _WATER_REACH_PX)
    smooth = texture < _WATER_TEXTURE * np.median(texture)
    _, parts = cv2.connectedComponents(smooth.astype(np.uint8))
    top = np.unique(parts[: max(2, baseline.shape[0] // 10)])
    return np.asarray(np.isin(parts, top[top > 0]))


def _absorption(light: Linear, sands: Labels, dye: Dye) -> Linear:
    """Return k - k_grain ln(I / local mean) of every pixel and channel, at least 0."""
    logs = np.log(np.maximum(light, _LEAST_LIGHT))
    mean = np.log(np.maximum(cv2.GaussianBlur(light, (0, 0), _LOCAL_MEAN_PX), _LEAST_LIGHT))
    grains = np.clip(logs - mean, -_GRAIN_LIMIT, _GRAIN_LIMIT)
    absorption = np.asarray(dye.absorption, np.float32)[:, ::-1][sands]
    dyed = absorption.max(axis=2, keepdims=True) > 0
    found = absorption - grains * np.asarray(dye.grain, np.float32)[::-1]
    return np.asarray(np.where(dyed, np.maximum(found, 0.0), 0.0), np.float32)


def _moved(light: Linear, shot: Shot) -> Linear:
    """Return the scene in the pose of `shot`."""
    if shot.shift == (0.0, 0.0) and shot.rotation == 0.0:
        return light
    rows, columns = light.shape[:2]
    move = cv2.getRotationMatrix2D((0.5 * (columns - 1), 0.5 * (rows - 1)), shot.rotation, 1.0)
    move[:, 2] += np.asarray(shot.shift)
    return np.asarray(
        cv2.warpAffine(
            light, move, (columns, rows), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
    )


def _lamps(shot: Shot, shape: tuple[int, int]) -> Linear:
    """Return the factor of the lamps on every pixel and channel."""
    down = np.linspace(-0.5, 0.5, shape[0], dtype=np.float32)[:, None, None]
    across = np.linspace(-0.5, 0.5, shape[1], dtype=np.float32)[None, :, None]
    even = 1.0 + shot.slope[0] * across + shot.slope[1] * down
    tint = np.array([1.0 - shot.warmth, 1.0, 1.0 + shot.warmth], np.float32)
    return np.asarray(shot.gain * even * tint, np.float32)
