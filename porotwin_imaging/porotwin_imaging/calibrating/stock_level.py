"""The signal of tracer stock in each sand, from the cores of the plumes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.calibrating.plume_core import (
    CORE,
    Core,
    find_core,
    plume_depth,
    strong_signal,
)
from porotwin_imaging.calibrating.sands import SandLevel
from porotwin_imaging.numerics.robust_statistics import SPREAD_PER_DEVIATION

Array = NDArray[Any]
Labels = NDArray[np.uint8]


@dataclass(frozen=True)
class StockLevels:
    """The cores of all photographs and the signal of stock that they show.

    Attributes:
        levels: signal of stock by sand; empty if no plume has a core.
        cores: by photograph, the core in each sand that has one.
        strong: strong signal of all photographs [-].
        depths: depth inside the plumes of each photograph [cells], shape (nz, nx).
    """

    levels: dict[int, SandLevel]
    cores: tuple[dict[int, Core], ...]
    strong: float
    depths: tuple[Array, ...]


def stock_levels(
    signals: Sequence[Array],
    labels: Labels,
    concentrations: Sequence[float],
) -> StockLevels:
    """Return the signal of stock in each sand.

    A core counts if it is flat and begins no nearer to the edge of the plume than the core of the
    sand with most cells. So pale tracer that creeps into a fine sand is no core.

    Args:
        signals: signal of each photograph [-], shape (nz, nx), NaN where it is hidden.
        labels: index of the sand in each cell, same shape.
        concentrations: concentration of the core in each photograph [-], 1 = stock.
    """
    strong = strong_signal(signals)
    depths = [plume_depth(plane, strong) for plane in signals]
    inner = _away_from_interfaces(labels)
    found = [
        _cores_by_sand(plane, np.where(inner, depth, 0.0), labels)
        for plane, depth in zip(signals, depths, strict=True)
    ]
    levels = {}
    for sand in range(int(labels.max()) + 1):
        cores = [
            (cores[sand], concentration)
            for cores, concentration in zip(found, concentrations, strict=True)
            if sand in cores
        ]
        if cores:
            levels[sand] = _level(cores)
    return StockLevels(levels, tuple(found), strong, tuple(depths))


def _away_from_interfaces(labels: Labels) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) that are not near another sand."""
    kernel = np.ones((2 * CORE.interface_cells + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(labels, kernel) == cv2.erode(labels, kernel))


def _cores_by_sand(signal: Array, depth: Array, labels: Labels) -> dict[int, Core]:
    """Return the core in each sand of one photograph; `depth` is 0 where cells do not count."""
    found = {}
    for sand in range(int(labels.max()) + 1):
        core = find_core(signal, np.where(labels == sand, depth, 0.0))
        if core is not None and abs(core.flatness) < CORE.flattest:
            found[sand] = core
    if not found:
        return {}
    main = max(found.values(), key=lambda core: int(core.cells.sum()))
    return {sand: core for sand, core in found.items() if core.depth >= main.depth}


def _level(cores: Sequence[tuple[Core, float]]) -> SandLevel:
    """Return the signal of stock by the cores of one sand and their concentrations."""
    levels = np.array([core.level / concentration for core, concentration in cores])
    cells = np.array([core.cells.sum() for core, _ in cores])
    middle = float(np.median(np.repeat(levels, cells)))
    spread = SPREAD_PER_DEVIATION * float(np.median(np.abs(levels - middle))) / middle
    deviation = float(np.hypot(CORE.level_error, spread / np.sqrt(len(levels))))
    return SandLevel(middle, deviation, int(cells.sum()))


def diluted_signals(
    photographs: Sequence[tuple[float, Array]],
    labels: Labels,
    factors: Array,
) -> list[tuple[float, float]]:
    """Return (concentration, signal) of known dilutions, the signal times the factor of its sand.

    Every sand with a core in a photograph gives one pair.

    Args:
        photographs: concentration of the core, and signal (nz, nx), of each photograph.
        labels: index of the sand in each cell, same shape.
        factors: factor on the signal of each cell, same shape.

    Raises:
        InputError: a photograph has no core.
    """
    pairs = []
    inner = _away_from_interfaces(labels)
    for concentration, signal in photographs:
        strong = strong_signal([signal])
        depth = plume_depth(signal, strong)
        depth = np.where(inner & (strong > 0), depth, 0.0)  # no plume: no depth
        cores = _cores_by_sand(signal * factors, depth, labels)
        if not cores:
            raise InputError(
                f'calibration: the dilution {concentration:g} shows no even plume; fill a region '
                'of sand until its colour is even'
            )
        pairs += [(concentration, core.level) for core in cores.values()]
    return pairs
