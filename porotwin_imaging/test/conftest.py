"""A small laboratory for the tests: a rig with mottled sand, tracer, a chart and JPEG files."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from kept_baselines import kept_baselines
from numpy.typing import NDArray
from undrawn_pictures import undrawn

from porotwin_core.geometry.grid import conservative_resample
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.light.colour_checker import REFERENCE
from porotwin_imaging.tracer.calibration import Calibration, Response
from porotwin_imaging.tracer.tracer_signal import TracerSignal

__all__ = ['kept_baselines', 'undrawn']

SHARED = Path(__file__).resolve().parents[2].parent / 'shared'
TRACER_PHOTOGRAPHS = SHARED / 'data' / 'fluidflower_tracer'

WIDTH, HEIGHT = 0.9, 0.5
PX_PER_M = 900.0
FIRST_COLUMN, FIRST_ROW = 40, 150
"""Upper left corner of the sand in the photographs [px]."""
TRUE_SHAPE = (450, 810)
"""Cells of true maps: one per pixel of the photographs."""
NO_TRACER = np.zeros((2, 2))


@dataclass
class Laboratory:
    """Renders photographs of a rig of 0.9 m x 0.5 m with pixels of 1.1 mm.

    Attributes:
        transmission: share of red, green and blue light that passes through tracer stock.
        finer_below: height [m] of the interface to a finer sand; 0 for one sand.
        uptake: factor on the colour of tracer in the upper and the lower sand.
        seed: seed of the grains.
        size: columns and rows of the photographs [px].
        chart_at: column and row of the colour chart [px].
    """

    transmission: tuple[float, float, float] = (0.35, 0.6, 0.45)
    finer_below: float = 0.0
    uptake: tuple[float, float] = (1.0, 1.0)
    seed: int = 5
    size: tuple[int, int] = (890, 640)
    chart_at: tuple[int, int] = (60, 25)
    _grains: NDArray[np.floating] = field(init=False)

    def __post_init__(self) -> None:
        generator = np.random.default_rng(self.seed)
        rows, columns = self.size[1], self.size[0]
        coarse = generator.normal(0, 1, (rows // 3 + 1, columns // 3 + 1)).astype(np.float32)
        self._grains = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
        self._kept = lru_cache(maxsize=8)(self._drawn)

    @property
    def rig(self) -> Rig:
        first_column, first_row = FIRST_COLUMN, FIRST_ROW
        last_column, last_row = first_column + WIDTH * PX_PER_M, first_row + HEIGHT * PX_PER_M
        x, y = self.chart_at
        w, h = 145.0, 95.0
        return Rig.model_validate(
            {
                'name': 'test',
                'width_m': WIDTH,
                'height_m': HEIGHT,
                'depth_m': 0.01,
                'porosity': 0.4,
                'permeability_m2': 1e-9,
                'viscosity_pa_s': 1e-3,
                'density_kg_m3': 998.0,
                'wells': {'injector': {'x_m': 0.3, 'z_m': 0.2}},
                'camera': {
                    'corners_px': [
                        [first_column, first_row],
                        [first_column, last_row],
                        [last_column, last_row],
                        [last_column, first_row],
                    ],
                    'colour_checker_px': [[x, y], [x, y + h], [x + w, y + h], [x + w, y]],
                },
            }
        )

    def scene(self, concentration: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return linear red, green, blue of the rig with a map (nz, nx) of tracer."""
        return self._kept(concentration.astype(np.float32).tobytes(), concentration.shape).copy()

    def _drawn(self, values: bytes, shape: tuple[int, int]) -> NDArray[np.floating]:
        concentration = np.frombuffer(values, np.float32).reshape(shape)
        rows, columns = self.size[1], self.size[0]
        light = np.full((rows, columns, 3), 0.3, np.float32) * [1.0, 0.9, 0.5]
        last_row = int(FIRST_ROW + HEIGHT * PX_PER_M)
        last_column = int(FIRST_COLUMN + WIDTH * PX_PER_M)
        inside = (slice(FIRST_ROW, last_row), slice(FIRST_COLUMN, last_column))
        shown = cv2.resize(
            np.ascontiguousarray(concentration[::-1]),
            (last_column - FIRST_COLUMN, last_row - FIRST_ROW),
            interpolation=cv2.INTER_LINEAR,
        )
        height = HEIGHT - (np.arange(last_row - FIRST_ROW) + 0.5) / PX_PER_M
        fine = np.broadcast_to((height < self.finer_below)[:, None], shown.shape)
        contrast = np.where(fine, 0.06, 0.25)
        shade = np.clip(1 + contrast * self._grains[inside], 0.3, None)
        tone = np.where(fine[..., None], [0.34, 0.26, 0.2], [0.2, 0.14, 0.1])
        uptake = np.where(fine, self.uptake[1], self.uptake[0])
        passing = 1 - (1 - np.array(self.transmission)) * (shown * uptake)[..., None]
        light[inside] = tone * shade[..., None] * passing
        self._chart(light)
        return light.astype(np.float32)

    def _chart(self, light: NDArray[np.floating]) -> None:
        x, y = self.chart_at
        light[y - 10 : y + 105, x - 10 : x + 155] = 0.012
        for index in range(24):
            row, column = divmod(index, 6)
            first_row, first_column = y + 25 * row, x + 25 * column
            area = (slice(first_row, first_row + 20), slice(first_column, first_column + 20))
            light[area] = np.clip(REFERENCE[index], 0.005, 1)

    def photograph(
        self,
        concentration: NDArray[np.floating],
        *,
        gain: float = 1.0,
        slope: float = 0.0,
        shift: tuple[float, float] = (0.0, 0.0),
        noise: float = 1.0,
        seed: int = 9,
    ) -> bytes:
        """Return a JPEG file.

        Args:
            concentration: map of tracer, shape (nz, nx).
            gain: factor on the light.
            slope: relative change of the light from the left to the right edge.
            shift: movement of the camera to the right and down [px].
            noise: standard deviation of the sensor noise [grey levels].
            seed: seed of the noise.
        """
        light = self.scene(concentration) * gain
        light = light * (1 + slope * np.linspace(-0.5, 0.5, self.size[0]))[None, :, None]
        move = np.array([[1.0, 0, shift[0]], [0, 1.0, shift[1]]])
        light = cv2.warpAffine(
            light.astype(np.float32), move, self.size, flags=cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        return encode(light, noise=noise, seed=seed)


def encode(light: NDArray[np.floating], *, noise: float = 1.0, seed: int = 9) -> bytes:
    """Return linear red, green, blue as a JPEG file in sRGB, with sensor noise."""
    light = np.clip(light, 0, 1)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    levels = 255 * curve + np.random.default_rng(seed).normal(0, noise, light.shape)
    pixels = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    _, data = cv2.imencode('.jpg', pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
    return data.tobytes()


def plume(shape: tuple[int, int], x: float, z: float, radius: float) -> NDArray[np.floating]:
    """Return a round plume of tracer stock with a smooth rim, shape (nz, nx), lengths in [m]."""
    nz, nx = shape
    zz, xx = np.meshgrid(
        (np.arange(nz) + 0.5) * HEIGHT / nz, (np.arange(nx) + 0.5) * WIDTH / nx, indexing='ij'
    )
    return 0.5 * (1 - np.tanh((np.hypot(xx - x, zz - z) - radius) / 0.01))


@pytest.fixture(scope='session')
def laboratory() -> Laboratory:
    return Laboratory()


@pytest.fixture(scope='session')
def new_laboratory():
    return Laboratory


@pytest.fixture(scope='session')
def make_plume():
    return plume


@pytest.fixture(scope='session')
def make_jpeg():
    return encode


@pytest.fixture(scope='session')
def tracer_photographs() -> Path:
    if not (TRACER_PHOTOGRAPHS / 'tracer_3.jpg').is_file():
        pytest.skip(f'needs the real photographs in {TRACER_PHOTOGRAPHS}')
    return TRACER_PHOTOGRAPHS


@pytest.fixture(scope='session')
def calibration() -> Calibration:
    """The calibration of the default laboratory."""
    return Calibration(
        TracerSignal('difference', (1.0, 0.0, 0.0)),
        Response((0.0, 0.65), (0.0, 1.0)),
        scale_error=0.01,
    )


@pytest.fixture(scope='session')
def empty_photograph(laboratory) -> bytes:
    """A photograph of the default laboratory without tracer."""
    return laboratory.photograph(NO_TRACER, seed=1)


@pytest.fixture(scope='session')
def baseline(laboratory, calibration, empty_photograph) -> Baseline:
    """The baseline of the default laboratory on a grid of 90 x 50 cells."""
    grid = laboratory.rig.grid(90, 50)
    return make_baseline(laboratory.rig, grid, [empty_photograph], calibration=calibration)


@pytest.fixture(scope='session')
def true_map() -> NDArray[np.floating]:
    """A true map with a plume in the middle of the rig."""
    return plume(TRUE_SHAPE, 0.4, 0.25, 0.12)


@pytest.fixture(scope='session')
def photograph_of_plume(laboratory, true_map) -> bytes:
    """A photograph of the default laboratory with the true map."""
    return laboratory.photograph(true_map)


@pytest.fixture(scope='session')
def true_shape() -> tuple[int, int]:
    return TRUE_SHAPE


@pytest.fixture(scope='session')
def no_tracer() -> NDArray[np.floating]:
    return NO_TRACER


@pytest.fixture(scope='session')
def relative_error() -> Callable[[NDArray[np.floating], NDArray[np.floating]], float]:
    """A function (values, truth) -> relative L2 error over the visible cells."""

    def error(values: NDArray[np.floating], truth: NDArray[np.floating]) -> float:
        truth = conservative_resample(truth, values.shape)
        visible = np.isfinite(values)
        return float(np.linalg.norm((values - truth)[visible]) / np.linalg.norm(truth[visible]))

    return error
