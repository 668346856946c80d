"""Renders photographs from a map of the tracer.

The dye absorbs light. A signal s multiplies each colour channel of a sand by
1 - (1 - T)(1 - exp(-b s)) / (1 - exp(-b)), T the transmission at full signal: monotone and nearly
proportional. Lamps drift, the camera shakes, the sensor is noisy, and the file is a JPEG with its
time of exposure. A seed and the time of the photograph determine everything.
"""

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TypeVar

import cv2
import numba
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.ExifTags import IFD, Base

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_recording.tables.photos import VIRTUAL_CAMERA
from porotwin_rig.camera import VirtualCamera, camera_before
from porotwin_rig.scene import FULL_SCALE, Scene, build_scene

FloatArray = NDArray[np.floating]
Picture = TypeVar('Picture', NDArray[np.uint8], NDArray[np.uint16])

DYE = np.array([0.42, 0.62, 0.27])
"""Transmission (blue, green, red) of tracer stock in front of sand: a dark green."""

RESPONSE_BEND = 0.25
"""b in the response above. 0 is proportional; 0.25 deviates by 3 % of the range at half signal."""

_LEVELS = 1024
"""Levels of the signal in the table of the dye: finer than a step of the JPEG."""

_CODES = 8192
"""Entries of the sensor curve: finer than a step of the JPEG in the darkest parts."""

START = datetime(2022, 6, 1, 9, 0, tzinfo=UTC)
"""Date and time at time 0 by default."""

_TILE = 512
"""Side of the tile of sensor noise [px], a power of two; repeated with random offsets."""

_REDUCED_WIDTH_PX = 1600
"""Width up to which the signal is read at every pixel [px]; above, on a coarser raster."""

_LAMP_PERIODS_S = (4200.0, 1500.0, 3300.0, 900.0, 5100.0)
"""Periods of the drifts of the lamps [s]: tens of minutes, without a common multiple."""


@dataclass(frozen=True)
class Conditions:
    """Deviations of photographs from ideal ones.

    Args:
        light_drift: relative amplitude of the brightness of the lamps, over tens of minutes.
        light_gradient: relative amplitude of its slope across the photograph.
        noise: standard deviation of the sensor noise, in steps of 255.
        shake_px: standard deviation of the shift of every photograph [px at 1600 px width].
        shift_px: shift (right, down) of the camera after the baseline [px].
        rotation_rad: rotation of the camera after the baseline, counter-clockwise.
        quality: JPEG quality, 0 to 100.
    """

    light_drift: float = 0.03
    light_gradient: float = 0.02
    noise: float = 1.3
    shake_px: float = 0.4
    shift_px: tuple[float, float] = (0.0, 0.0)
    rotation_rad: float = 0.0
    quality: int = 92


@numba.njit(cache=True, nogil=True)
def _expose(
    light: NDArray[np.uint16],
    sand: NDArray[np.uint8],
    signal: NDArray[np.uint16],
    dye: NDArray[np.float32],
    lamp: NDArray[np.float32],
    codes: NDArray[np.float32],
    noise: NDArray[np.float32],
    offset: int,
) -> NDArray[np.uint8]:
    """Return pixels (rows, columns, 3) with dye, lamp, sensor curve and noise in one pass."""
    rows, columns = sand.shape
    pixels = np.empty((rows, columns, 3), np.uint8)
    side = noise.shape[0] - 1
    scale = np.float32(codes.size - 1) / np.float32(FULL_SCALE)
    for r in range(rows):
        down = np.float32(r) / np.float32(rows) - np.float32(0.5)
        for c in range(columns):
            across = np.float32(c) / np.float32(columns) - np.float32(0.5)
            slope = np.float32(1.0) + lamp[3] * across + lamp[4] * down
            kind = sand[r, c]
            level = signal[r, c]
            for k in range(3):
                value = np.float32(light[r, c, k]) * lamp[k] * slope
                if kind > 0:
                    value *= dye[kind - 1, level, k]
                code = int(value * scale)
                if code > codes.size - 1:
                    code = codes.size - 1
                place = noise[(r + offset + 171 * k) & side, (c + 3 * offset + 67 * k) & side]
                shown = codes[code] + place
                pixels[r, c, k] = np.uint8(min(max(shown + np.float32(0.5), 0.0), 255.0))
    return pixels


class Photographer:
    """Takes photographs of one rig with one camera.

    Building the scene takes about a second at 1600 px and half a minute at 8000 px. A photograph
    takes a small part of this time.

    Args:
        rig: sizes, wells and sands; its `camera` section is ignored.
        camera: the camera; by default 1600 x 1000 px with the rig filling the view.
        conditions: light, noise and shake.
        seed: seed of all random patterns.

    Attributes:
        start: date and time at time 0, for the exposure times in the files.
        rig: the rig with the `camera` section that describes these photographs.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        camera: VirtualCamera | None = None,
        conditions: Conditions | None = None,
        seed: int,
    ) -> None:
        self.camera = camera or camera_before(rig)
        self.conditions = conditions or Conditions()
        self.seed = seed
        self.start = START
        self.rig = rig.model_copy(update={'camera': self.camera.description()})
        self._scene = build_scene(rig, self.camera, seed=seed)
        self._dye = _dye_table(self._scene)
        self._codes = _sensor_curve()
        generator = np.random.default_rng([seed, 2])
        self._noise = generator.normal(0.0, self.conditions.noise, (_TILE, _TILE)).astype(
            np.float32
        )
        self._phases = generator.uniform(0.0, 2.0 * math.pi, 8)
        self._reduction = max(1, self.camera.width_px // _REDUCED_WIDTH_PX)
        self._map_u, self._map_v = self._signal_positions()

    def photograph(self, signal: FloatArray, *, time: float, baseline: bool = False) -> bytes:
        """Return a photograph as a JPEG file.

        Args:
            signal: signal of the tracer, (nz, nx), 0 to 1; its cells cover the whole rig.
            time: time of the photograph [s].
            baseline: whether the photograph is taken before the camera is displaced.

        Raises:
            InputError: the signal is not a map of finite numbers.
        """
        if signal.ndim != 2 or not np.isfinite(signal).all():
            raise InputError(f'signal of shape {signal.shape}: give a map (nz, nx) without NaN')
        generator = np.random.default_rng([self.seed, 3, round(time * 1000), int(baseline)])
        move = self._move(generator, displaced=not baseline)
        levels = self._levels(signal)
        light, sand = self._scene.light, self._scene.sand
        size = (self.camera.width_px, self.camera.height_px)
        if move is not None:
            light = _moved(light, move, size, cv2.INTER_LINEAR)
            sand = _moved(sand, move, size, cv2.INTER_NEAREST)
            levels = _moved(levels, move, size, cv2.INTER_LINEAR)
        pixels = _expose(
            light,
            sand,
            levels,
            self._dye,
            self._lamp(time),
            self._codes,
            self._noise,
            int(generator.integers(_TILE)),
        )
        whole, encoded = cv2.imencode(
            '.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, self.conditions.quality]
        )
        if not whole:
            raise RuntimeError('JPEG encoder failed')
        return _with_exposure_time(encoded.tobytes(), self.start + timedelta(seconds=time))

    def baseline(self, *, time: float = 0.0) -> bytes:
        """Return a photograph without tracer, taken at `time` [s]."""
        return self.photograph(np.zeros((2, 2)), time=time, baseline=True)

    def _signal_positions(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the place of each (reduced) pixel relative to the rig: right and up, 0 to 1."""
        step = self._reduction
        column, row = np.meshgrid(
            np.arange(0, self.camera.width_px, step) + 0.5 * (step - 1),
            np.arange(0, self.camera.height_px, step) + 0.5 * (step - 1),
        )
        x, z = self.camera.to_metres(column, row)
        layout = self.camera.layout
        return (x / layout.width).astype(np.float32), (z / layout.height).astype(np.float32)

    def _levels(self, signal: FloatArray) -> NDArray[np.uint16]:
        """Return the signal at every pixel as a level of the table of the dye."""
        rows, columns = signal.shape
        seen = cv2.remap(
            np.ascontiguousarray(signal, np.float32),
            self._map_u * columns - np.float32(0.5),
            self._map_v * rows - np.float32(0.5),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )
        levels = np.clip(seen * (_LEVELS - 1) + 0.5, 0, _LEVELS - 1)
        if self._reduction > 1:
            wanted = (levels.shape[1] * self._reduction, levels.shape[0] * self._reduction)
            levels = cv2.resize(levels, wanted, interpolation=cv2.INTER_LINEAR)
            levels = levels[: self.camera.height_px, : self.camera.width_px]
        return np.ascontiguousarray(levels).astype(np.uint16)

    def _move(self, generator: np.random.Generator, *, displaced: bool) -> FloatArray | None:
        """Return the affine matrix (2, 3) that displaces this photograph; None for the identity."""
        scale = self.camera.width_px / _REDUCED_WIDTH_PX
        shift = generator.normal(0.0, 1.0, 2) * (self.conditions.shake_px * scale)
        turn = 0.0
        if displaced:
            shift = shift + np.asarray(self.conditions.shift_px)
            turn = self.conditions.rotation_rad
        if turn == 0.0 and not shift.any():
            return None
        middle = (0.5 * self.camera.width_px, 0.5 * self.camera.height_px)
        move = cv2.getRotationMatrix2D(middle, math.degrees(turn), 1.0)
        return np.column_stack((move[:, :2], move[:, 2] + shift))

    def _lamp(self, time: float) -> NDArray[np.float32]:
        """Return the lamps at `time` [s]: factors of blue, green, red; slopes across and down."""
        drift, gradient = self.conditions.light_drift, self.conditions.light_gradient
        waves = [
            math.sin(2.0 * math.pi * time / period + phase)
            for period, phase in zip(_LAMP_PERIODS_S, self._phases, strict=False)
        ]
        level = 1.0 + drift * (0.75 * waves[0] + 0.25 * waves[1])
        warmth = 0.2 * drift * waves[2]
        slopes = gradient * np.array([waves[3] + waves[4], waves[4] - waves[0]])
        return np.array(
            [level * (1 - warmth), level, level * (1 + warmth), *slopes], dtype=np.float32
        )


def _moved(picture: Picture, move: FloatArray, size: tuple[int, int], how: int) -> Picture:
    moved = cv2.warpAffine(picture, move, size, flags=how, borderMode=cv2.BORDER_REPLICATE)
    return moved.astype(picture.dtype, copy=False)


def _dye_table(scene: Scene) -> NDArray[np.float32]:
    """Return the transmission by sand, level of the signal and channel."""
    signal = np.linspace(0.0, 1.0, _LEVELS)
    response = np.expm1(-RESPONSE_BEND * signal) / math.expm1(-RESPONSE_BEND)
    taken = np.array([(1.0 - DYE) * sand.uptake for sand in scene.sands])
    return (1.0 - response[None, :, None] * taken[:, None, :]).astype(np.float32)


def _sensor_curve() -> NDArray[np.float32]:
    """Return the sRGB code (0 to 255) of linear light, in `_CODES` steps."""
    linear = np.linspace(0.0, 1.0, _CODES)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (255.0 * curve).astype(np.float32)


def _with_exposure_time(jpeg: bytes, taken: datetime) -> bytes:
    """Return the JPEG file with the time of exposure, to the millisecond, in its EXIF."""
    exif = Image.Exif()
    exif[Base.Model] = VIRTUAL_CAMERA
    details = exif.get_ifd(IFD.Exif)
    details[Base.DateTimeOriginal] = taken.strftime('%Y:%m:%d %H:%M:%S')
    details[Base.OffsetTimeOriginal] = '+00:00'
    details[Base.SubsecTimeOriginal] = f'{taken.microsecond // 1000:03d}'
    payload = exif.tobytes()
    return jpeg[:2] + b'\xff\xe1' + (len(payload) + 2).to_bytes(2, 'big') + payload + jpeg[2:]
