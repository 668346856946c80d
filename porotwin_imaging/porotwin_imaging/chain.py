"""The imaging chain: from the bytes of a photograph to a map of tracer concentration.

    imaging = Imaging(rig, grid)
    imaging.set_baselines([jpeg_bytes, ...])
    map = imaging.concentration(jpeg_bytes)
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_imaging import photograph, validity
from porotwin_imaging.geometry import Geometry
from porotwin_imaging.registration import Aligner, Alignment
from porotwin_imaging.sampling import Sampling, choose_reduction
from porotwin_imaging.total_variation import denoise

Array = NDArray[np.floating]

_LINEAR = np.where(
    np.arange(256) / 255 <= 0.04045,
    np.arange(256) / 255 / 12.92,
    ((np.arange(256) / 255 + 0.055) / 1.055) ** 2.4,
).astype(np.float32)
"""Linear light of the 256 grey levels of sRGB."""


@dataclass(frozen=True)
class Settings:
    """How the chain works; lengths in metres."""

    smoothing_m: float = 2e-4
    tolerance: float = 1e-3
    least_valid_share: float = 0.3
    reported_shift_px: float = 1.0


@dataclass(frozen=True)
class ConcentrationMap:
    """A map of tracer concentration, read from one photograph.

    `values` (nz, nx) float32, row 0 the bottom, 1 = tracer stock, NaN where the photograph says
    nothing; `noise` (nz, nx): standard deviation of `values`; `status`: what a reader should know,
    one line each; `timings`: seconds by stage; `alignment`: how the camera had moved.
    """

    values: NDArray[np.float32]
    noise: NDArray[np.float32]
    status: list[str]
    timings: dict[str, float]
    alignment: Alignment


@dataclass
class _Stopwatch:
    timings: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.timings[name] = self.timings.get(name, 0.0) + time.perf_counter() - start


class Imaging:
    """The chain of one camera and rig; `set_baselines` first, then any number of photographs."""

    def __init__(self, rig: Rig, grid: Grid, *, settings: Settings = Settings()) -> None:
        self.rig = rig
        self.grid = grid
        self.settings = settings
        self._geometry = Geometry.of(rig)
        self._ready = False

    def set_baselines(self, photographs: Sequence[bytes]) -> list[str]:
        """Take photographs without tracer as the reference of all that follow.

        Raises:
            InputError: no photograph, or one that cannot be used.
        """
        if not photographs:
            raise InputError('no baseline photograph: give one taken before the injection')
        self._photo_size = photograph.size(photographs[0])
        self._refuse_outside(self._photo_size)
        self._reduction = choose_reduction(self._geometry, self.grid, self._photo_size[0])
        self._sampling = Sampling.of(self._geometry, self.grid, self._reduction)
        first = photograph.decode(photographs[0], self._reduction)
        self._aligner = Aligner(first.pixels, self._region(first.pixels.shape))
        sampled = []
        for data in photographs:
            picture = self._decode(data)
            alignment = self._aligner.align(picture.pixels)
            sampled.append(self._sampling.sample(_linear(picture.pixels), alignment.homography))
        self._baseline = np.mean(sampled, axis=0)
        self._mask = validity.lit(self._baseline).astype(np.float32)
        self._baseline *= self._mask[..., None]
        self._valid_share = self._sampling.cell_means(self._mask)
        self._reference = self._sampling.cell_means(self._baseline)
        self._ready = True
        return []

    def concentration(self, data: bytes) -> ConcentrationMap:
        """Return the concentration that the photograph `data` (the file's bytes) shows.

        Raises:
            InputError: the photograph cannot be used; one line says why.
        """
        if not self._ready:
            raise InputError('no baseline yet: give a photograph taken before the injection')
        watch = _Stopwatch()
        status: list[str] = ['uncalibrated: default scaling']
        with watch.stage('decode'):
            picture = self._decode(data)
        with watch.stage('align'):
            alignment = self._aligner.align(picture.pixels)
        if alignment.shift * self._reduction > self.settings.reported_shift_px:
            status.append(f'camera moved by {alignment.shift * self._reduction:.1f} px')
        with watch.stage('remap'):
            sampled = self._sampling.sample(_linear(picture.pixels), alignment.homography)
            sampled *= self._mask[..., None]
            state = self._sampling.cell_means(sampled)
        with watch.stage('signal'):
            ratio = state[..., 2] / np.maximum(self._reference[..., 2], 1e-6)
            signal = -np.log(np.maximum(ratio, 0.02))
            known = self._valid_share > self.settings.least_valid_share
            signal = np.where(known, signal, np.nan)
        with watch.stage('denoise'):
            smooth = denoise(
                signal,
                self._valid_share,
                spacing=(self.grid.dz, self.grid.dx),
                length=self.settings.smoothing_m,
                tolerance=self.settings.tolerance,
            )
        values = np.where(known, np.clip(smooth.values, 0.0, 1.0), np.nan).astype(np.float32)
        return ConcentrationMap(
            values, np.full_like(values, np.nan), status, watch.timings, alignment
        )

    def _decode(self, data: bytes) -> photograph.Photograph:
        size = photograph.size(data)
        if size != self._photo_size:
            raise InputError(
                f'photograph is {size[0]} x {size[1]} px, the baseline {self._photo_size[0]} x '
                f'{self._photo_size[1]} px; keep the camera as it is or take a new baseline'
            )
        return photograph.decode(data, self._reduction)

    def _refuse_outside(self, size: tuple[int, int]) -> None:
        assert self.rig.camera is not None
        corners = np.array(self.rig.camera.corners_px)
        slack = 0.02 * size[0]
        if (corners < -slack).any() or (corners > np.array(size) + slack).any():
            raise InputError(
                f'photograph is {size[0]} x {size[1]} px, but camera.corners_px reach to '
                f'{corners.max(axis=0).tolist()}; correct rig.yaml or use photographs of this rig'
            )

    def _region(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        assert self.rig.camera is not None
        corners = np.array(self.rig.camera.corners_px) / self._reduction
        region = np.zeros(shape[:2], np.uint8)
        cv2.fillPoly(region, [np.rint(corners).astype(np.int32)], 1)
        return region.astype(bool)


def _linear(pixels: NDArray[np.uint8]) -> Array:
    return cv2.LUT(pixels, _LINEAR)
