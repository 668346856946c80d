"""The bend of the response and the blur of the camera, from the fronts of an injected plume.

A model of the flow tells the pore volume in which the true concentration exceeds a level. The
photograph tells the pore volume in which the signal exceeds one. Both fall from the volume of the
plume to that of its core, wherever the plume lies. A bent response moves all levels to one side, a
blur moves high and low levels apart. The modelled map is therefore photographed:

    concentration --blur--> response --> light --blur--> signal of tiles --> volume above levels

Unknown are the bend, the blur, the dispersivity of the sand, and a common factor of all volumes
(porosity, sorption, pumps). The factor is not the bend, because it grows with the plume: the share
of its front falls. Dispersion is not the blur for the same reason.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE
from porotwin_imaging.numerics.cell_sums import tile_of
from porotwin_imaging.tracer.calibration import CLEAN
from porotwin_imaging.tracer.response_curve import concentration_of
from porotwin_imaging.tracer.tracer_signal import LEAST_RATIO, Contrast


@dataclass(frozen=True)
class FrontSettings:
    """The bend of the response and the blur of the camera from fronts (`front_response.py`)."""

    dispersivities_m: tuple[float, ...] = (0.0, 1e-4, 5e-4, 1.6e-3, 4e-3)
    """Dispersivities along the flow that are modelled [m], from none to that of coarse gravel."""
    level_error: float = 0.01
    """Standard deviation of the volume above a level, relative to the width of a front, from the
    first to the last level [-]: grains and cells. On composed photographs it is 0.005 to 0.01."""
    offset_error: float = 3e-4
    """Standard deviation of the volume at zero injection, relative to the largest [-]: dead volume
    and clocks. An offset of 0.002 that nobody tells bends the response by 0.025."""
    factor_error: float = 0.1
    """Standard deviation of the common factor of all volumes [-]: porosity, sorption, pumps."""
    model_error: float = 0.015
    """Standard deviation of the bend from a model that is not the rig [-], if it fits to
    `level_error`: 0.01 on composed photographs. It grows with the misfit."""
    most_misfit: float = 0.05
    """Larger distances from the model are no evidence, relative to the width of a front [-]."""
    least_share: float = 0.1
    """Photographs with less of the largest injected volume are not compared [-]."""
    surest_factor: float = 0.05
    """Sands with a larger relative deviation of their factor do not count [-]."""


FRONTS = FrontSettings()


Array = NDArray[Any]

PlumeModel = Callable[[float, float], Sequence[Array]]
"""Model of an injection: from a factor on the injected volume [-] and the dispersivity along the
flow [m] to the true concentration at the times of all photographs, each (rows, columns)."""

_LEVELS = np.linspace(0.14, 0.86, 10)
"""Levels of the relative signal [-]. Beyond them noise about water and stock counts."""
_HALF_RAMP = 0.07
"""Half width of a level [-]: a cell counts gradually, because cells at a front are few."""
_BENDS = np.array([-0.16, -0.09, -0.02, 0.05, 0.12])
_EDGE = 0.02
"""A bend this near to the low end of the range may lie beyond it [-]. The high end is no limit: a
dark dye that takes away light in proportion to its concentration bends by 0.09 to 0.13."""
_BLURS_PX = np.array([0.3, 1.2, 2.1, 3.0])
_FINE = (71, 19, 13)
"""Bends, blurs and dispersivities to which the photographed models are interpolated."""
_TONE = 2.2
"""Grey levels are light to the power 1 / 2.2; JPEG and remapping blur grey levels."""
_POINTS = (2, 6)
"""Fewest and most points of a modelled map across a cell."""
_MARGIN_CELLS = 4
"""Surroundings of a plume that its blur reaches [cells]."""


@dataclass(frozen=True)
class FrontFit:
    """The evidence of fronts.

    Attributes:
        bend: bend of the response (`response_curve`) [-].
        deviation: its standard deviation [-].
        blur_px: standard deviation of the blur of the camera [px of the file].
        dispersivity_m: dispersivity of the sand, and of the scheme of the model, along the flow.
        misfit: root mean square distance of the volumes, relative to the width of a front [-].
        at_end: True if the bend lies at the low end of the range that is tried.
    """

    bend: float
    deviation: float
    blur_px: float
    dispersivity_m: float
    misfit: float
    at_end: bool = False


@dataclass(frozen=True)
class FrontPhotographs:
    """Photographs of an injection, as the fronts are compared in them.

    Attributes:
        signals: signal relative to stock [-], each (nz, nx), NaN where hidden.
        pore_volume: pore volume of the cells [m^3], 0 where the factor of the sand is not known.
        chosen: numbers of the photographs that are compared.
        contrast: kind of the signal.
        stock: signal of tracer stock [-]: its absorbance, or the share of light that it takes.
        pixels_per_cell: pixels of the file across a cell.
        samples_across: samples of the photograph across a cell.
    """

    signals: Sequence[Array]
    pore_volume: Array
    chosen: Sequence[int]
    contrast: Contrast
    stock: float
    pixels_per_cell: float
    samples_across: int


def fit_fronts(
    seen: FrontPhotographs,
    model: PlumeModel,
    mass_factor: float,
) -> FrontFit | None:
    """Return the evidence of the fronts; None if they are too few or unlike the model.

    Args:
        seen: the photographs.
        model: the modelled injection.
        mass_factor: imaged over injected volume, roughly [-].

    Raises:
        InputError: the model cannot run.
    """
    most = MASS_BALANCE.most_factor
    if len(seen.chosen) < MASS_BALANCE.fewest_photographs or not 1 / most < mass_factor < most:
        return None
    hidden = np.any([~np.isfinite(seen.signals[number]) for number in seen.chosen], axis=0)
    volume = np.where(hidden, 0.0, seen.pore_volume)
    measured = np.array([_volumes(np.nan_to_num(seen.signals[n]), volume) for n in seen.chosen])
    modelled = [model(mass_factor, dispersivity) for dispersivity in FRONTS.dispersivities_m]
    table = np.array([_photographed(maps, seen, volume) for maps in modelled])
    widths = measured[:, 0] - measured[:, -1]
    if not (widths > 0).all() or not measured.all():
        return None
    bends, blurs, roots, fine = _interpolated(table)
    squares, count = _over_offsets(measured, fine, widths)
    best = np.unravel_index(int(squares.argmin()), squares.shape)
    misfit = FRONTS.level_error * float(np.sqrt(squares[best] / count))
    if misfit > FRONTS.most_misfit:
        return None
    worse = max(1.0, float(squares[best]) / count)
    likely = np.exp(-0.5 * (squares - squares[best]) / worse)
    by_bend = likely.sum(axis=(0, 2))
    bend = float(np.average(bends, weights=by_bend))
    spread = float(np.sqrt(np.average((bends - bend) ** 2, weights=by_bend)))
    blur = float(np.average(blurs, weights=likely.sum(axis=(0, 1))))
    worse_fit = max(1.0, misfit / FRONTS.level_error)
    return FrontFit(
        bend=bend,
        deviation=float(np.hypot(spread, FRONTS.model_error * worse_fit)),
        blur_px=float(np.hypot(blur, _interpolation_px(modelled[0][0], seen))),
        dispersivity_m=float(np.average(roots**2, weights=likely.sum(axis=(1, 2)))),
        misfit=misfit,
        at_end=bool(bend <= _BENDS[0] + _EDGE),
    )


def _interpolation_px(concentration: Array, seen: FrontPhotographs) -> float:
    """Return the blur of linear interpolation between the cells of a modelled map [px].

    The photograph shows it beside the fitted blur: a map of cells knows no sharper front.
    """
    columns = seen.pore_volume.shape[1] / concentration.shape[1]
    return seen.pixels_per_cell * columns / math.sqrt(6.0)


def _volumes(signal: Array, volume: Array) -> Array:
    """Return the pore volume [m^3] above each of the levels."""
    inside = (signal > _LEVELS[0] - _HALF_RAMP) & (volume > 0)
    values, weights = signal[inside], volume[inside]
    ramps = (values - _LEVELS[:, None] + _HALF_RAMP) / (2 * _HALF_RAMP)
    return np.asarray(np.clip(ramps, 0.0, 1.0) @ weights)


def _photographed(maps: Sequence[Array], seen: FrontPhotographs, volume: Array) -> Array:
    """Return the volumes [m^3] of modelled maps, shape (bends, blurs, photographs, levels)."""
    found = np.zeros((len(_BENDS), len(_BLURS_PX), len(seen.chosen), len(_LEVELS)))
    points = int(np.clip(seen.samples_across, *_POINTS))
    for column, number in enumerate(seen.chosen):
        finer, place = _around_plume(maps[number], volume.shape, points)
        for row, blur_px in enumerate(_BLURS_PX):
            # half of the blur before the response (glass and sand), half after it (lens, file)
            width = float(blur_px) / seen.pixels_per_cell * points / np.sqrt(2.0)
            blurred = cv2.GaussianBlur(finer, (0, 0), width)
            for layer, bend in enumerate(_BENDS):
                signal = _response(blurred, float(bend))
                cells = _of_cells(signal, width, points, seen)
                found[layer, row, column] = _volumes(cells, volume[place])
    return found


def _around_plume(
    concentration: Array, shape: tuple[int, ...], points: int
) -> tuple[Array, tuple[slice, slice]]:
    """Return a map around its plume with `points` points across a cell, and its cells.

    `shape` is that of the cells. The map has whole cells and a margin about the plume.
    """
    single = np.asarray(concentration, np.float32)
    rows, columns = shape
    cells = cv2.resize(single, (columns, rows), interpolation=cv2.INTER_AREA) > CLEAN
    place = []
    for axis, size in ((1, rows), (0, columns)):
        used = np.nonzero(cells.any(axis=axis))[0]
        low, high = (used[0], used[-1] + 1) if used.size else (0, size)
        place.append(slice(max(0, low - _MARGIN_CELLS), min(size, high + _MARGIN_CELLS)))
    finer = cv2.resize(single, (columns * points, rows * points), interpolation=cv2.INTER_LINEAR)
    up, across = (slice(one.start * points, one.stop * points) for one in place)
    return np.ascontiguousarray(finer[up, across]), (place[0], place[1])


def _response(concentration: Array, bend: float) -> Array:
    """Return the relative signal of a map of concentration."""
    signals = np.linspace(0.0, 1.0, 401)
    found = np.interp(concentration, concentration_of(signals, bend), signals)
    return np.asarray(found, np.float32)


def _of_cells(signal: Array, width: float, points: int, seen: FrontPhotographs) -> Array:
    """Return the signal that cells of `points` points show, as `cell_sums` averages them.

    Lens and file blur grey levels, tiles of a cell average light, and cells average logarithms.
    """
    rows, columns = (size // points for size in signal.shape)
    light = _light(signal, seen)
    grey = cv2.GaussianBlur(light ** np.float32(1.0 / _TONE), (0, 0), width)
    parts = points // tile_of(points)
    tiles = cv2.resize(grey**_TONE, (columns * parts, rows * parts), interpolation=cv2.INTER_AREA)
    logs = cv2.resize(np.log(tiles), (columns, rows), interpolation=cv2.INTER_AREA)
    if seen.contrast == 'absorbance':
        return np.asarray(-logs / seen.stock)
    return np.asarray((1.0 - np.exp(logs)) / seen.stock)


def _light(signal: Array, seen: FrontPhotographs) -> Array:
    """Return the light relative to the baseline of a map of relative signal."""
    if seen.contrast == 'absorbance':
        return np.asarray(np.exp(-seen.stock * signal), np.float32)
    return np.asarray(np.maximum(1.0 - seen.stock * signal, LEAST_RATIO), np.float32)


def _interpolated(table: Array) -> tuple[Array, Array, Array, Array]:
    """Return bends, blurs, roots of dispersivities, and the table at them.

    The first three axes of the result are dispersivity, bend and blur. The width of a front grows
    with the root of the dispersivity.
    """
    nodes = np.sqrt(FRONTS.dispersivities_m)
    bends = np.linspace(_BENDS[0], _BENDS[-1], _FINE[0])
    blurs = np.linspace(_BLURS_PX[0], _BLURS_PX[-1], _FINE[1])
    roots = np.linspace(nodes[0], nodes[-1], _FINE[2])
    fine = CubicSpline(_BENDS, table, axis=1)(bends)
    fine = CubicSpline(_BLURS_PX, fine, axis=2)(blurs)
    return bends, blurs, roots, PchipInterpolator(nodes, fine, axis=0)(roots)


def _over_offsets(measured: Array, fine: Array, widths: Array) -> tuple[Array, int]:
    """Return the sum of squares for every dispersivity, bend and blur, and the number of data.

    Volumes before the injection are nearly 0. They are not if only then a model fits: a clock is
    minutes off, for example.
    """
    count = measured.size
    usual = _misfits(measured, fine, widths, FRONTS.offset_error)
    if FRONTS.level_error * math.sqrt(float(usual.min()) / count) <= FRONTS.most_misfit:
        return usual, count
    return _misfits(measured, fine, widths, MASS_BALANCE.faulty_offset), count


def _misfits(measured: Array, fine: Array, widths: Array, offset_error: float) -> Array:
    """Return the sum of squares for every dispersivity, bend and blur.

    The factor of all volumes is free. `offset_error` is the standard deviation of the volume before
    the injection, relative to the largest.
    """
    data, models = measured.ravel(), fine.reshape(*fine.shape[:3], -1)
    covariance = np.diag(np.repeat((FRONTS.level_error * widths) ** 2, len(_LEVELS)))
    covariance += (offset_error * measured.max()) ** 2
    covariance += FRONTS.factor_error**2 * np.outer(data, data)
    apart = np.linalg.solve(
        np.linalg.cholesky(covariance), (data - models).reshape(-1, data.size).T
    )
    return np.asarray((apart**2).sum(axis=0).reshape(fine.shape[:3]))
