"""The scene without tracer: sand, frame, board with bolts, colour chart."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.rig import Rig
from porotwin_rig.camera import CHART_HEIGHT, CHART_WIDTH, VirtualCamera
from porotwin_rig.chart import chart_colours

FloatArray = NDArray[np.floating]

FULL_SCALE = float(np.iinfo(np.uint16).max)
"""Linear light 1.0 in the 16 bits of a scene."""

MOST_SANDS = 6
"""Sands that are told apart by permeability; a continuous map is divided into as many classes."""

_STEPS = 24.0
"""Standard deviation of a mottled field in the steps of its 8 bits."""

_BAND_ROWS = 256
"""Rows of the photograph that are made at a time, so that memory does not grow with its size."""

# linear (red, green, blue) of coarse and fine sand, of the board and of the frame
_COARSE = np.array([0.145, 0.098, 0.066])
_FINE = np.array([0.315, 0.228, 0.165])
_BOARD = np.array([0.52, 0.44, 0.21])
_FRAME = np.array([0.012, 0.012, 0.013])


@dataclass(frozen=True)
class SandAppearance:
    """The appearance of one sand in photographs.

    Args:
        colour: mean linear (red, green, blue).
        grain: size of a grain [m].
        contrast: standard deviation of the brightness of grains, relative to the mean.
        uptake: strength of the colour of tracer on this sand, relative to other sands.
    """

    colour: FloatArray
    grain: float
    contrast: float
    uptake: float


@dataclass(frozen=True)
class Scene:
    """The scene in pixels.

    Args:
        light: linear (blue, green, red) in units of 1 / `FULL_SCALE`, (rows, columns, 3).
        sand: 0 without sand, else 1 + the index of the sand, (rows, columns).
        sands: the sands.
    """

    light: NDArray[np.uint16]
    sand: NDArray[np.uint8]
    sands: tuple[SandAppearance, ...]


def sands_of(rig: Rig) -> tuple[tuple[SandAppearance, ...], NDArray[np.integer]]:
    """Return the sands of `rig` and the map of their indices, (nz, nx), row 0 at the bottom.

    Sands differ in permeability. Coarse sand is dark and mottled, fine sand light and smooth; the
    size of grains follows Hazen's rule, d ~ sqrt(k).
    """
    nominal = rig.nominal_map('permeability_m2')
    permeability = np.atleast_2d(np.asarray(nominal, dtype=float))
    levels = np.unique(np.round(np.log10(permeability), 2))
    if len(levels) > MOST_SANDS:
        levels = np.linspace(levels[0], levels[-1], MOST_SANDS)
    labels = np.argmin(np.abs(np.log10(permeability)[..., None] - levels), axis=-1)
    sands = []
    for level in levels:
        coarse = float(np.clip((level + 11.0) / 2.5, 0.0, 1.0))
        sands.append(
            SandAppearance(
                colour=_FINE + coarse * (_COARSE - _FINE),
                grain=4e-4 + 1.1e-3 * coarse**2,
                contrast=0.10 + 0.32 * coarse,
                uptake=0.85 + 0.15 * coarse,
            )
        )
    return tuple(sands), labels


def build_scene(rig: Rig, camera: VirtualCamera, *, seed: int) -> Scene:
    """Return the scene of `rig` as `camera` sees it; all random patterns follow from `seed`."""
    generator = np.random.default_rng([seed, 1])
    rows, columns = camera.height_px, camera.width_px
    sands, labels = sands_of(rig)
    light = np.empty((rows, columns, 3), np.uint16)
    sand = np.zeros((rows, columns), np.uint8)
    px_per_m = camera.width_px / (camera.layout.width + 2 * camera.layout.side)
    textures = [_grains((rows, columns), kind.grain * px_per_m, generator) for kind in sands]
    hue = _grains((rows, columns), sands[-1].grain * px_per_m, generator)
    strata = _strata(camera, generator)
    bolts = _bolts(camera)
    for start in range(0, rows, _BAND_ROWS):
        band = slice(start, min(start + _BAND_ROWS, rows))
        column, row = np.meshgrid(
            np.arange(columns, dtype=float), np.arange(rows, dtype=float)[band]
        )
        x, z = camera.to_metres(column, row)
        inside = (x > 0) & (x < rig.width_m) & (z > 0) & (z < rig.height_m)
        colours = _surroundings(camera, x, z, bolts)
        where = _label_at(labels, x / rig.width_m, z / rig.height_m)
        for number, kind in enumerate(sands):
            here = inside & (where == number)
            if not here.any():
                continue
            brightness = kind.contrast / _STEPS * textures[number][band][here]
            layer = strata(x[here], z[here]) * (0.11 - 0.2 * kind.contrast)
            tint = 0.4 * kind.contrast / _STEPS * hue[band][here]
            shade = np.maximum(1.0 + brightness + layer, 0.25)[:, None]
            colours[here] = kind.colour * shade * (1.0 + tint[:, None] * [1.0, 0.1, -0.7])
            sand[band][here] = number + 1
        for well in rig.wells.values():
            distance = np.hypot(x - well.x_m, z - well.z_m) / (0.7 * well.radius_m)
            colours *= (1.0 - 0.75 / (1.0 + distance**8))[..., None]
        colours *= _vignette(camera, column, row)[..., None]
        light[band] = np.clip(colours[..., ::-1] * FULL_SCALE, 0, FULL_SCALE).astype(np.uint16)
    blurred = cv2.GaussianBlur(light, (0, 0), 0.55)  # the lens
    return Scene(blurred.astype(np.uint16, copy=False), sand, sands)


def _grains(
    shape: tuple[int, int], size_px: float, generator: np.random.Generator
) -> NDArray[np.int8]:
    """Return a mottled field with grains of about `size_px` [px] and deviation `_STEPS`."""
    size = max(1.0, 0.6 * size_px)
    coarse = tuple(math.ceil(n / size) + 2 for n in shape)
    field = generator.standard_normal(coarse, dtype=np.float32)
    if size > 1.0:
        wanted = (math.ceil(coarse[1] * size), math.ceil(coarse[0] * size))
        field = np.asarray(cv2.resize(field, wanted, interpolation=cv2.INTER_CUBIC), np.float32)
        field += 0.5 * generator.standard_normal(field.shape, dtype=np.float32)
    field = np.asarray(field[: shape[0], : shape[1]])
    field += np.float32(0.35) * (field * field - 1.0)  # a few grains glint, most are dull
    field *= np.float32(_STEPS) / field.std()
    return np.clip(np.rint(field, out=field), -127, 127).astype(np.int8)


def _strata(
    camera: VirtualCamera, generator: np.random.Generator
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Return a function of (x, z) [m]: thin layers from pouring, with deviation 1."""
    thickness = 0.004 * camera.layout.scale
    count = math.ceil(camera.layout.height / thickness) + 40
    line = generator.standard_normal(count)
    phase = generator.uniform(0, 2 * math.pi, 3)

    def strata(x: FloatArray, z: FloatArray) -> FloatArray:
        swing = sum(
            0.006 * camera.layout.scale / (n + 1) * np.sin((n + 1) * 4.0 * x + phase[n])
            for n in range(3)
        )
        return np.interp((z + swing) / thickness + 15.0, np.arange(count), line)

    return strata


def _label_at(labels: NDArray[np.integer], u: FloatArray, v: FloatArray) -> NDArray[np.integer]:
    """Return the label at relative positions (u right, v up), smooth along interfaces."""
    if labels.size == 1:
        return np.zeros(u.shape, dtype=int)
    rows, columns = labels.shape
    map_x = (u * columns - 0.5).astype(np.float32)
    map_y = (v * rows - 0.5).astype(np.float32)
    best = np.full(u.shape, -1.0, np.float32)
    chosen = np.zeros(u.shape, dtype=int)
    for number in range(int(labels.max()) + 1):
        share = cv2.GaussianBlur((labels == number).astype(np.float32), (0, 0), 0.8)
        here = cv2.remap(share, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        chosen = np.where(here > best, number, chosen)
        best = np.maximum(best, here)
    return chosen


def _bolts(camera: VirtualCamera) -> FloatArray:
    """Return the places (x, z) [m] of the bolts that hold the plates together, (6, 2)."""
    layout = camera.layout
    first = 0.045 * layout.scale + CHART_WIDTH * layout.scale + 0.05 * layout.scale
    xs = np.linspace(first, layout.width - 0.04 * layout.scale, 6)
    return np.stack((xs, np.full(6, layout.height + 0.62 * layout.board)), axis=1)


def _surroundings(
    camera: VirtualCamera, x: FloatArray, z: FloatArray, bolts: FloatArray
) -> FloatArray:
    """Return linear (red, green, blue) of everything except the sand."""
    layout = camera.layout
    on_board = (
        (z >= layout.height) & (x > -0.3 * layout.side) & (x < layout.width + 0.3 * layout.side)
    )
    on_board &= z < layout.height + 0.97 * layout.board
    # a damp edge above the sand, and shade towards the top
    above = np.clip((z - layout.height) / layout.board, 0.0, 1.0)
    tone = (0.62 + 0.38 * np.clip(above * 6.0, 0, 1)) * (1.0 - 0.10 * above)
    colours = np.where(on_board[..., None], _BOARD * tone[..., None], _FRAME)
    shadow_x, shadow_z = layout.chart_point(3.25, 2.2)
    half = 0.5 * CHART_WIDTH * layout.scale, 0.5 * CHART_HEIGHT * layout.scale
    reach = np.maximum(np.abs(x - shadow_x) / half[0], np.abs(z - shadow_z) / half[1])
    colours *= (1.0 - 0.45 / (1.0 + np.exp(np.minimum((reach - 1.22) * 40.0, 50.0))))[..., None]
    for bolt in bolts:
        distance = np.hypot(x - bolt[0], z - bolt[1]) / (0.011 * layout.scale)
        angle = np.arctan2(z - bolt[1], x - bolt[0])
        metal = 0.10 + 0.09 * np.cos(2.0 * angle - 0.7) + 0.05 * (distance < 0.35)
        metal = np.where(np.abs(distance - 0.4) < 0.07, 0.015, metal)
        colours = np.where((distance < 1.0)[..., None], metal[..., None], colours)
        ring = (distance >= 1.0) & (distance < 1.3)
        colours = np.where(ring[..., None], colours * 0.55, colours)
    left, top = layout.chart_point(0, 0)
    right, bottom = layout.chart_point(6, 4)
    column = 6.0 * (x - left) / (right - left)
    row = 4.0 * (top - z) / (top - bottom)
    on_chart = (column > -0.45) & (column < 6.45) & (row > -0.45) & (row < 4.45)
    colours[on_chart] = chart_colours(column[on_chart], row[on_chart])
    return colours


def _vignette(camera: VirtualCamera, column: FloatArray, row: FloatArray) -> FloatArray:
    """Return the brightness of the lens, 1 in the middle and less towards the corners."""
    along = (column / camera.width_px - 0.5) ** 2
    down = (row / camera.height_px - 0.5) ** 2
    return 1.0 - 0.22 * (along + down)
