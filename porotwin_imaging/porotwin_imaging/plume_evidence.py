"""The plume of an injection: its place and its volume, without any scale of the signal.

A plume that is injected fills the pores around its well. Where the signal exceeds half of its level
inside the plume, the injected fluid fills the pores, whatever the dye, the sand and the response.
The pore volume of that region bounds the injected volume.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule

Array = NDArray[Any]

_BLUR_CELLS = 1.5
"""The signal is smoothed over this reach: single cells are noise [cells]."""
_TOP_SHARE, _LEVEL_PERCENTILE = 0.5, 60.0
"""Level inside the plume: this percentile of the signals above this share of the largest one."""
_HALF = 0.5
"""Edge of a plume relative to its level [-]."""
_FEWEST_CELLS = 40
"""Cells of a plume whose place is known."""
_REACH = 1.3
"""A plume belongs to a well within this many of its radii."""


@dataclass(frozen=True)
class PlumeEvidence:
    """The plume of an injection.

    Attributes:
        pore_volume: pore volume of the region above half of its level, in the last photograph
            [m^3]; NaN if no photograph shows a plume.
        fluid: volume of tracer fluid of any concentration that the pump log injected until then
            [m^3]; NaN without a pump log.
        strongest: largest concentration of the injected fluid in the pump log [-]; NaN without.
        told_wells: wells that inject tracer in the pump log.
        seen_wells: wells inside or beside the first plumes.
        place: (x, z) of the middle of the first plume [m].
        hollow: signal at the injecting well relative to the level of the plume [-]; the middle of
            an injected plume is as strong as its surroundings. NaN if the well is not known.
    """

    pore_volume: float
    fluid: float
    strongest: float
    told_wells: tuple[str, ...]
    seen_wells: tuple[str, ...]
    place: tuple[float, float]
    hollow: float

    @property
    def filled(self) -> float:
        """Pore volume of the plume over the injected volume [-]; NaN if one is not known."""
        return self.pore_volume / self.fluid if self.fluid > 0 else math.nan


def plume_evidence(
    signals: Sequence[Array],
    times: Sequence[float],
    *,
    rig: Rig,
    grid: Grid,
    schedule: Schedule | None,
) -> PlumeEvidence:
    """Return the plume of an injection.

    Args:
        signals: signal times sand factor of each photograph, shape (nz, nx), NaN where hidden.
        times: exposure times [s], ascending.
        rig: the rig with its wells.
        grid: the grid of the signals.
        schedule: the pump log, None if it is not known.
    """
    volume = rig.cell_pore_volume(grid)
    regions = [_region(signal) for signal in signals]
    large = [region for region, _ in regions if region.sum() >= _FEWEST_CELLS]
    last, level = regions[-1]
    told = _told_wells(schedule, times[-1])
    if not large:
        return PlumeEvidence(math.nan, math.nan, math.nan, told, (), (math.nan, math.nan), math.nan)
    seen, place = _wells_at(large[0], rig, grid)
    strongest = max((row.rate.concentration for row in _tracer_rows(schedule)), default=math.nan)
    return PlumeEvidence(
        pore_volume=float(volume[last].sum()),
        fluid=_fluid(schedule, times[-1]),
        strongest=strongest,
        told_wells=told,
        seen_wells=seen,
        place=place,
        hollow=_hollow(signals[-1], level, [name for name in told if name in seen], rig, grid),
    )


def _region(signal: Array) -> tuple[NDArray[np.bool_], float]:
    """Return the cells above half of the level of the plume, and the level."""
    smooth = cv2.GaussianBlur(np.nan_to_num(signal).astype(np.float32), (0, 0), _BLUR_CELLS)
    top = float(smooth.max())
    if top <= 0:
        return np.zeros(signal.shape, bool), 0.0
    level = float(np.percentile(smooth[smooth > _TOP_SHARE * top], _LEVEL_PERCENTILE))
    return smooth > _HALF * level, level


def _tracer_rows(schedule: Schedule | None) -> list[Any]:
    """Return the rows of the pump log that inject tracer."""
    rows = schedule.rows if schedule is not None else ()
    return [row for row in rows if row.rate.rate > 0 and row.rate.concentration > 0]


def _told_wells(schedule: Schedule | None, until: float) -> tuple[str, ...]:
    """Return the wells that inject tracer before `until` [s]."""
    return tuple(dict.fromkeys(row.well for row in _tracer_rows(schedule) if row.time < until))


def _fluid(schedule: Schedule | None, until: float) -> float:
    """Return the volume [m^3] of fluid with tracer injected before `until` [s]."""
    if schedule is None or not schedule.rows:
        return math.nan
    start = min(row.time for row in schedule.rows)
    return sum(
        (high - low) * well.rate
        for low, high, rates in schedule.intervals(min(start, until), until)
        for well in rates.values()
        if well.rate > 0 and well.concentration > 0
    )


def _wells_at(
    region: NDArray[np.bool_], rig: Rig, grid: Grid
) -> tuple[tuple[str, ...], tuple[float, float]]:
    """Return the wells in or beside the parts of `region`, and the middle of its largest part."""
    count, _, stats, middles = cv2.connectedComponentsWithStats(region.astype(np.uint8))
    areas = stats[1:, cv2.CC_STAT_AREA]
    found: list[str] = []
    place = (math.nan, math.nan)
    for label in range(1, count):
        if areas[label - 1] < _FEWEST_CELLS:
            continue
        x, z = (middles[label] + 0.5) * np.array([grid.dx, grid.dz])
        radius = math.sqrt(areas[label - 1] * grid.cell_area / math.pi)
        if areas[label - 1] == areas.max():
            place = (float(x), float(z))
        found += [
            name
            for name, well in rig.wells.items()
            if math.hypot(well.x_m - x, well.z_m - z) <= _REACH * radius
        ]
    return tuple(dict.fromkeys(found)), place


def _hollow(signal: Array, level: float, wells: list[str], rig: Rig, grid: Grid) -> float:
    """Return the median signal near the first of `wells` relative to `level`."""
    if not wells or level <= 0:
        return math.nan
    well = rig.wells[wells[0]]
    row, column = int(well.z_m / grid.dz), int(well.x_m / grid.dx)
    around = signal[max(0, row - 2) : row + 3, max(0, column - 2) : column + 3]
    return float(np.nanmedian(around)) / level if np.isfinite(around).any() else math.nan
