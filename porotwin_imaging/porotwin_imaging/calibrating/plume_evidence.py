"""The plume of an injection: its place and its volume, without any scale of the signal.

Injected tracer fills the pores around its well. The region where the signal exceeds half of the
level inside the plume holds the injected fluid, for any dye, sand and response. So the area of the
plume times porosity and depth must equal the injected volume. On composed photographs it does so
to 2 %.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule, ScheduleRow
from porotwin_core.rig import Rig
from porotwin_imaging.tracer.tracer_colour import FEWEST_CELLS

Array = NDArray[Any]
Mask = NDArray[np.bool_]

_BLUR_CELLS = 1.5
"""The signal is smoothed over this reach: single cells are noise [cells]."""
_HALF, _LEVEL_PERCENTILE = 0.5, 60.0
"""Level inside the plume: this percentile of the signals above half of the largest one; the edge
lies at half of the level. Photographs with half of the largest injected volume show the volume of
the plume."""
_MIDDLE = 0.25
"""The middle of a plume, relative to its radius; this share of it tells whether it is pale [-]."""
_MARGIN_CELLS = 3
"""A well belongs to a plume within this distance of its outline [cells]."""


@dataclass(frozen=True)
class PlumeEvidence:
    """The plume of an injection.

    Attributes:
        pore_volume: pore volume of the region above half of its level, after all of the tracer
            [m^3]; NaN without a plume or pump log.
        fluid: volume of fluid with tracer that the pump log injected until then [m^3]; NaN without
            a pump log.
        strongest: largest concentration of the injected fluid in the pump log [-]; NaN without.
        told_wells: wells that inject tracer in the pump log.
        seen_wells: wells inside the outline of a plume.
        hollow: signal at the injecting well relative to the level of the plume [-]; the middle of
            an injected plume is as strong as its surroundings. NaN if no plume is there.
        apart: distance from the plume of the first photographs to the nearest well that injects
            tracer, relative to the width of the rig [-]; 0 without a plume or pump log.
    """

    pore_volume: float
    fluid: float
    strongest: float
    told_wells: tuple[str, ...]
    seen_wells: tuple[str, ...]
    hollow: float
    apart: float

    @property
    def filled(self) -> float:
        """Pore volume of the plume over the injected volume [-]; NaN if one is not known."""
        return self.pore_volume / self.fluid if self.fluid > 0 else math.nan

    @property
    def is_elsewhere(self) -> bool:
        """Whether the plume is at another well than the pump log says."""
        told, seen = set(self.told_wells), set(self.seen_wells)
        return bool(told and seen) and told.isdisjoint(seen)


def plume_evidence(
    signals: Sequence[Array],
    times: Sequence[float],
    rig: Rig,
    storage: Array,
    *,
    grid: Grid,
    schedule: Schedule | None,
) -> PlumeEvidence:
    """Return the plume of an injection.

    Only photographs before the first injection of water count, if there are any.

    Args:
        signals: signal times sand factor of each photograph, shape (nz, nx), NaN where hidden.
        times: exposure times [s], ascending.
        rig: the rig with its wells.
        storage: stock of each cell per unit of concentration [m^3], (nz, nx).
        grid: the grid of the signals.
        schedule: the pump log, None if it is not known.
    """
    count = max(1, sum(time <= _tracer_alone_until(schedule) for time in times))
    found = [_region(signal) for signal in signals[:count]]
    rows = _tracer_rows(schedule)
    told = tuple(dict.fromkeys(row.well for row in rows if row.time < times[count - 1]))
    outline = _outline(found[-1][0])
    wells = {name: _cell(rig, name, grid) for name in rig.wells}
    seen = tuple(name for name, cell in wells.items() if outline[cell])
    fluids = [_fluid(schedule, time) for time in times[:count]]
    fluid = max(fluids)
    return PlumeEvidence(
        pore_volume=fluid * _filled([region for region, _ in found], fluids, storage),
        fluid=fluid,
        strongest=max((row.rate.concentration for row in rows), default=math.nan),
        told_wells=told,
        seen_wells=seen,
        hollow=_hollow(
            signals[:count],
            found,
            fluids,
            [
                _injecting(schedule, time, {w: wells[w] for w in told if w in seen})
                for time in times[:count]
            ],
        ),
        apart=_apart([region for region, _ in found], fluids, [wells[w] for w in told], grid),
    )


def _region(signal: Array) -> tuple[Mask, float]:
    """Return the cells above half of the level of the plume, and the level."""
    smooth = cv2.GaussianBlur(np.nan_to_num(signal).astype(np.float32), (0, 0), _BLUR_CELLS)
    top = float(smooth.max())
    if top <= 0:
        return np.zeros(signal.shape, bool), 0.0
    level = float(np.percentile(smooth[smooth > _HALF * top], _LEVEL_PERCENTILE))
    return smooth > _HALF * level, level


def _outline(region: Mask) -> Mask:
    """Return the large parts of `region` with their holes filled and a margin."""
    filled = np.zeros(region.shape, np.uint8)
    contours, _ = cv2.findContours(
        region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    for contour in contours:
        part = np.zeros(region.shape, np.uint8)
        cv2.drawContours(part, [contour], -1, 1, cv2.FILLED)
        if region[part > 0].sum() >= FEWEST_CELLS:
            filled |= part
    return np.asarray(cv2.dilate(filled, np.ones((2 * _MARGIN_CELLS + 1,) * 2, np.uint8)) > 0)


def _tracer_rows(schedule: Schedule | None) -> list[ScheduleRow]:
    """Return the rows of the pump log that inject tracer."""
    rows = schedule.rows if schedule is not None else ()
    return [row for row in rows if row.rate.rate > 0 and row.rate.concentration > 0]


def _tracer_alone_until(schedule: Schedule | None) -> float:
    """Return the time [s] of the first injection of water in the pump log."""
    rows = schedule.rows if schedule is not None else ()
    return min(
        (row.time for row in rows if row.rate.rate > 0 and row.rate.concentration == 0),
        default=math.inf,
    )


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


def _filled(regions: Sequence[Mask], fluids: Sequence[float], volume: Array) -> float:
    """Return the median ratio of filled pores to injected fluid; NaN without plume or fluid."""
    ratios = [
        float(volume[region].sum()) / fluid
        for region, fluid in zip(regions, fluids, strict=True)
        if region.sum() >= FEWEST_CELLS and fluid > 0 and fluid >= _HALF * max(fluids)
    ]
    return float(np.median(ratios)) if ratios else math.nan


def _cell(rig: Rig, well: str, grid: Grid) -> tuple[int, int]:
    """Return row and column of the cell of a well."""
    place = rig.wells[well]
    return int(place.z_m / grid.dz), int(place.x_m / grid.dx)


def _injecting(
    schedule: Schedule | None, time: float, cells: Mapping[str, tuple[int, int]]
) -> tuple[int, int] | None:
    """Return the cell of the well among `cells` that injected tracer last before `time` [s].

    Clean water of a canal or another well flows past a well that rests.
    """
    latest = None
    for _, _, rates in schedule.intervals(-math.inf, time) if schedule else ():
        injecting = [w for w in cells if w in rates and rates[w].rate * rates[w].concentration > 0]
        latest = next((cells[well] for well in injecting), latest)
    return latest


def _hollow(
    signals: Sequence[Array],
    found: Sequence[tuple[Mask, float]],
    fluids: Sequence[float],
    cells: Sequence[tuple[int, int] | None],
) -> float:
    """Return the signal around the cell of each photograph relative to the level, in their median.

    Hidden cells count as empty: places brighter than the baseline are left out. A photograph
    without a cell tells nothing.
    """
    ratios = []
    for signal, (region, level), fluid, cell in zip(signals, found, fluids, cells, strict=True):
        if cell is not None and level > 0 and not fluid < _HALF * max(fluids):
            row, column = cell
            reach = max(2, int(_MIDDLE * math.sqrt(region.sum() / math.pi)))
            around = signal[
                max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1
            ]
            # flow past the well leaves tracer on one side of it only
            brightest = np.quantile(np.nan_to_num(around), 1.0 - _MIDDLE)
            ratios.append(float(brightest) / level)
    return float(np.median(ratios)) if ratios else math.nan


def _apart(
    regions: Sequence[Mask], fluids: Sequence[float], cells: Sequence[tuple[int, int]], grid: Grid
) -> float:
    """Return the distance from the plume to the nearest of `cells`, relative to the width.

    It is the median of the first half of the photographs with a plume: later plumes are so large
    that they reach other wells.
    """
    outlines = [
        outline
        for region, fluid in zip(regions, fluids, strict=True)
        if fluid > 0 and (outline := _outline(region)).any()
    ]
    if not outlines or not cells:
        return 0.0
    distances = []
    for outline in outlines[: (len(outlines) + 1) // 2]:
        rows, columns = np.nonzero(outline)
        distances.append(
            min(
                float(np.hypot((rows - row) * grid.dz, (columns - column) * grid.dx).min())
                for row, column in cells
            )
        )
    return float(np.median(distances)) / grid.width
