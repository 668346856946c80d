"""Oddities of the tracer in the maps of a recording, told before its diagnosis."""

import hashlib
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import FloatArray
from porotwin_core.plausibility import Remark
from porotwin_core.rig import Rig
from porotwin_core.units import ML
from porotwin_core.wells import Schedule
from porotwin_diagnosis.data.false_cells import cells_near, false_cells
from porotwin_diagnosis.data.initial_tracer import LONGEST_LATENESS, initial_tracer
from porotwin_diagnosis.data.misplaced_maps import misplaced_maps
from porotwin_diagnosis.data.observed_maps import FILLED_SHARE
from porotwin_imaging.mass_check import excess_remark
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.odd_recording import remarks_about_maps
from porotwin_recording.recording import Recording
from porotwin_solver.exact_solutions import radial_front

LOOKED_AT = 8
"""Maps of a recording that are compared with the injected tracer."""

MOST_OFFSET = 0.03
"""Concentration [-] of clean sand that is odd; light and shake leave less."""

TRACER_QUANTILE = 0.9
"""Share of the first map that is clean at least: a plume begins small."""

VISIBLE_TRACER = 0.1
"""Concentration [-] that a cell of a map exceeds if the map shows tracer."""

PURE = 0.5
"""Concentration [-] of injected fluid from which on its well is surely seen in the maps."""

REACH = 2.5
"""Reach of a plume over the radius of a disc of its volume [-]."""

EMPTY_LEVEL, FULL_LEVEL = 0.25, 0.5
"""Mean concentrations [-] around a well without tracer at most, and with tracer at least."""

LEAST_INJECTED, LEAST_HELD = 0.02, 0.3
"""Share of the pore volume that was injected before the first map, and share of it in that map: a
plume that is hardly there was flushed, or its pump did not run."""

TURNS: dict[str, Callable[[NDArray[np.bool_]], NDArray[np.bool_]]] = {
    '': lambda cells: cells,
    'upside down': lambda cells: cells[::-1],
    'swapped left and right': lambda cells: cells[:, ::-1],
    'turned by 180 degrees': lambda cells: cells[::-1, ::-1],
}
"""Ways to turn a map (nz, nx), by their names."""


def remarks_about_tracer(recording: Recording) -> Iterator[Remark]:
    """Yield the remarks about the tracer in the maps of `recording`.

    Raises:
        InputError: the recording holds no maps.
    """
    yield from remarks_about_maps(recording)
    maps, rates = recording.present_maps, recording.known_rates
    yield from _out_of_order(maps, rates)
    yield from _offset(maps)
    chosen = np.unique(np.linspace(0, len(maps) - 1, LOOKED_AT).astype(int)).tolist()
    yield from _false(recording.rig, maps, chosen)
    if rates is None:
        return

    def excess(index: int) -> str:
        return excess_remark(maps[index], float(maps.times[index]), recording.rig, rates)

    if told := excess(0):
        yield from _at_the_start(recording, rates, told)
        return
    yield from _lost_before(recording, rates)
    yield from _beyond_reach(recording, rates)
    yield from list(map(_remark, filter(None, map(excess, chosen))))[:1]
    yield from _not_at_wells(recording.rig, maps, rates, chosen)
    stock = [row.time for row in rates.rows if row.rate.rate > 0 and row.rate.concentration > 0]
    later = [index for index in chosen if stock and maps.times[index] > stock[0]]
    empty = [index for index in later if not np.any(maps[index] > VISIBLE_TRACER)]
    if 2 * len(empty) > len(later):
        yield _remark(
            f'{len(empty)} of {len(later)} maps that were looked at show no tracer, but stock is '
            f'injected from {stock[0]:g} s on; compare the clocks of camera and pumps'
        )


def _at_the_start(recording: Recording, rates: Schedule, told: str) -> Iterator[Remark]:
    """Yield a remark if the first map holds tracer, as `told`, while stock is injected."""
    maps = recording.present_maps
    inverted = np.nanmedian(maps[0]) > FULL_LEVEL
    start = float(maps.times[0])
    if inverted:
        yield _remark(f'{told}. If 1 is water in these maps, write 1 minus their values')
    elif initial_tracer(recording) is None:
        yield _remark(
            f'{told}. A late clock of the camera looks the same, and so does tracer from before '
            'the recording'
        )
    elif rates.injected_stock(start, float(maps.times[-1])) > 0.0:
        yield _remark(
            f'the first map, at {start:g} s, holds tracer from before the recording, with which '
            'the model starts; if the rig was clean then, compare the clocks of camera and pumps'
        )


def _lost_before(recording: Recording, rates: Schedule) -> Iterator[Remark]:
    """Yield a remark if the first map holds little of the stock that was injected before it."""
    maps, rig = recording.present_maps, recording.rig
    start = float(maps.times[0])
    pores = rig.cell_pore_volume(maps.grid)
    injected = rates.injected_stock(-np.inf, start)
    held = float(np.nansum(maps[0] * pores))
    if injected > LEAST_INJECTED * float(pores.sum()) and held < LEAST_HELD * injected:
        yield _remark(
            f'the first map, at {start:g} s, holds {held * ML:.3g} ml of tracer stock, but the '
            f'pumps injected {injected * ML:.3g} ml before it; if the rig was flushed, begin the '
            'rates after that'
        )


def _beyond_reach(recording: Recording, rates: Schedule) -> Iterator[Remark]:
    """Yield a remark if the first map shows tracer that no well can have brought there.

    The stock of a well fills a disc around it (`radial_front`). Flow stretches the disc, so that
    `REACH` of its radius counts, with the volume that a clock may be late for.
    """
    maps, rig = recording.present_maps, recording.rig
    start, end = float(maps.times[0]), float(maps.times[-1])
    late = start + LONGEST_LATENESS * (end - start)
    grid = maps.grid
    thickness = float(rig.cell_pore_volume(grid).mean()) / grid.cell_area
    x, z = np.meshgrid(grid.x, grid.z)
    far = np.nan_to_num(maps[0]) > VISIBLE_TRACER
    for name in rates.wells:
        alone = Schedule(tuple(row for row in rates.rows if row.well == name))
        radius = radial_front(alone.injected_stock(-np.inf, late), thickness=thickness)
        well = rig.wells[name]
        far &= np.hypot(x - well.x_m, z - well.z_m) > REACH * radius
    if far.mean() > FILLED_SHARE:
        yield _remark(
            f'the first map, at {start:g} s, shows tracer around x = {x[far].mean():.3g} m, '
            f'z = {z[far].mean():.3g} m, where no well can have brought it yet; is it from before '
            'the recording, or a reflection? Begin with a clean rig, or take a new baseline'
        )


def _out_of_order(maps: ConcentrationMaps, rates: Schedule | None) -> Iterator[Remark]:
    """Yield remarks about maps that repeat another one, or fit neither of their neighbours.

    One reading of the maps serves both.
    """
    digests: list[bytes] = []

    def noted() -> Iterator[FloatArray]:
        for values in maps:
            digests.append(hashlib.sha256(values.tobytes()).digest() if values.any() else b'')
            yield values

    misplaced = misplaced_maps(maps.times.tolist(), noted(), rates)
    yield from _frozen(maps.times, digests)
    if misplaced:
        named = ', '.join(f'{maps.times[number]:g}' for number in misplaced)
        yield _remark(
            f'{len(misplaced)} of {len(maps)} maps fit neither the map before nor the one after '
            f'them, at {named} s; were they exchanged, or is there a glare? Correct their times, '
            'or leave them out'
        )


def _frozen(times: FloatArray, digests: Sequence[bytes]) -> Iterator[Remark]:
    """Yield a remark if maps repeat another one to the last bit: their noise always differs.

    A map that is zero everywhere has an empty digest and may repeat.
    """
    known: dict[bytes, float] = {}
    same = []
    for time, digest in zip(times, digests, strict=True):
        if digest in known:
            same.append((time, known[digest]))
        if digest:
            known.setdefault(digest, time)
    if same:
        time, other = same[0]
        yield _remark(
            f'{len(same)} of {len(digests)} maps repeat another one to the last bit, the first at '
            f'{time:g} s that at {other:g} s; did the camera or its program stand still? Leave '
            'them out'
        )


def _false(rig: Rig, maps: ConcentrationMaps, chosen: Sequence[int]) -> Iterator[Remark]:
    """Yield a remark if single cells of the `chosen` maps are far off all others."""
    wells = cells_near(rig.wells.values(), maps.grid)
    found = np.concatenate([np.argwhere(false_cells(maps[index], wells)) for index in chosen])
    if len(found):
        row, column = found[0]
        yield _remark(
            f'{len(found)} cells in {len(chosen)} maps that were looked at are far above stock, or '
            f'unlike all their neighbours, the first at x = {maps.grid.x[column]:.3g} m, '
            f'z = {maps.grid.z[row]:.3g} m; look for a glare or a dead pixel. They count as unseen'
        )


def _not_at_wells(
    rig: Rig, maps: ConcentrationMaps, rates: Schedule, chosen: Sequence[int]
) -> Iterator[Remark]:
    """Yield a remark if tracer lies elsewhere than at the wells that inject it.

    It lies at the wells that take water out if the signs of the rates are exchanged. It lies at
    mirror images if the maps are turned: a file of rows from the top down is upside down, since z
    points up.
    """
    injecting: dict[str, list[float]] = {how: [] for how in TURNS}
    taking: list[float] = []
    for index in chosen:
        before, now = rates.at(float(maps.times[max(index - 1, 0)])), rates.at(maps.times[index])
        for name in (name for name, rate in now.items() if before.get(name) == rate):
            cells = cells_near([rig.wells[name]], maps.grid)
            if now[name].rate < 0:
                taking += _levels(maps[index], cells)
            elif now[name].rate > 0 and now[name].concentration > PURE:
                for how, turn in TURNS.items():
                    injecting[how] += _levels(maps[index], turn(cells))
    if not all(injecting.values()):  # no well injected stock where the maps show it
        return
    means = {how: float(np.mean(found)) for how, found in injecting.items()}
    if means[''] >= EMPTY_LEVEL:
        return
    turned = max(means, key=means.__getitem__)
    where_they_inject = f'where wells inject stock they show {means[""]:.2g} in the mean'
    if taking and np.mean(taking) > FULL_LEVEL:
        yield _remark(
            f'the rates seem to have the wrong sign: {where_they_inject}, and '
            f'{np.mean(taking):.2g} where wells take water out; a positive rate injects'
        )
    elif means[turned] > FULL_LEVEL:
        yield _remark(
            f'the maps seem to be {turned}: {where_they_inject}, and {means[turned]:.2g} at their '
            'mirror images; turn the maps, whose rows go from the bottom up and whose columns from '
            'left to right'
        )


def _levels(frame: FloatArray, cells: NDArray[np.bool_]) -> list[float]:
    """Return the known values of a map (nz, nx) in some cells."""
    seen = frame[cells]
    found: list[float] = seen[np.isfinite(seen)].tolist()
    return found


def _offset(maps: ConcentrationMaps) -> Iterator[Remark]:
    """Yield a remark if the first map, clean in most places, is not zero there."""
    first = maps[0]
    level = float(np.nanmedian(first)) if np.isfinite(first).any() else 0.0
    if abs(level) > MOST_OFFSET and np.nanquantile(first, TRACER_QUANTILE) < VISIBLE_TRACER:
        yield _remark(
            f'the first map shows {level:.2g} nearly everywhere, where water is 0; subtract it, or '
            'take a clean baseline'
        )


def _remark(text: str) -> Remark:
    """Return a line "what is wrong; what would mend it" as a remark about the maps."""
    why, _, remedy = text.partition('; ')
    return Remark('maps', '', why, remedy)
