"""Oddities of maps by themselves: order, copies, single cells, the level of clean sand."""

import hashlib
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.plausibility import Remark
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.false_cells import cells_near, false_cells
from porotwin_diagnosis.data.misplaced_maps import misplaced_maps
from porotwin_diagnosis.data.observed_maps import VISIBLE_TRACER
from porotwin_recording.tables.concentration import ConcentrationMaps

MOST_OFFSET = 0.03
"""Concentration [-] of clean sand that is odd; light and shake leave less."""

MOST_UNSEEN = 0.25
"""Share of the cells that no map shows, from which on it is odd."""

TRACER_QUANTILE = 0.9
"""Share of the first map that is clean at least: a plume begins small."""


LOOKED_AT = 8
"""Maps of a recording that are compared with the injected tracer."""


def looked_at(count: int) -> list[int]:
    """Return the numbers of at most `LOOKED_AT` of `count` maps, evenly spread to both ends."""
    numbers: list[int] = np.unique(np.linspace(0, count - 1, LOOKED_AT).astype(int)).tolist()
    return numbers


def remark_about_maps(text: str) -> Remark:
    """Return a line "what is wrong; what would mend it" as a remark about the maps."""
    why, _, remedy = text.partition('; ')
    return Remark('maps', '', why, remedy)


def remarks_about_order(maps: ConcentrationMaps, rates: Schedule | None) -> Iterator[Remark]:
    """Yield remarks about maps that are empty, repeat another one, or fit no neighbour.

    One reading of the maps serves both.
    """
    digests: list[bytes] = []
    empty: list[float] = []
    ever_seen = np.zeros(maps.grid.shape, dtype=bool)

    def noted() -> Iterator[FloatArray]:
        for time, values in zip(maps.times, maps, strict=True):
            seen = np.isfinite(values)
            np.logical_or(ever_seen, seen, out=ever_seen)
            if not seen.any():
                empty.append(float(time))
            known = seen.any() and bool(np.nan_to_num(values).any())
            digests.append(hashlib.sha256(values.tobytes()).digest() if known else b'')
            yield values

    misplaced = misplaced_maps(maps.times.tolist(), noted(), rates)
    yield from _unseen(empty, ever_seen)
    yield from _frozen(maps.times, digests)
    if misplaced:
        named = ', '.join(f'{maps.times[number]:g}' for number in misplaced)
        yield remark_about_maps(
            f'{len(misplaced)} of {len(maps)} maps fit neither the map before nor the one after '
            f'them, at {named} s; were they exchanged, or is there a glare? Correct their times, '
            'or leave them out'
        )


def _unseen(empty: Sequence[float], ever_seen: NDArray[np.bool_]) -> Iterator[Remark]:
    """Yield remarks about `empty` maps, by their times [s], and about cells that no map shows."""
    if empty:
        maps = '1 map holds' if len(empty) == 1 else f'{len(empty)} maps hold'
        yield remark_about_maps(
            f'{maps} no value (NaN everywhere), the first at {empty[0]:g} s; make them again, or '
            'leave them out'
        )
    unseen = 1.0 - float(ever_seen.mean())
    if ever_seen.any() and unseen > MOST_UNSEEN:
        yield remark_about_maps(
            f'{percent(unseen)} of the cells have no value (NaN) in any map; was something before '
            'the rig? What happens there is not judged'
        )


def _frozen(times: FloatArray, digests: Sequence[bytes]) -> Iterator[Remark]:
    """Yield a remark if maps repeat another one to the last bit: their noise always differs.

    A map that is zero or NaN everywhere has an empty digest and may repeat.
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
        yield remark_about_maps(
            f'{len(same)} of {len(digests)} maps repeat another one to the last bit, the first at '
            f'{time:g} s that at {other:g} s; did the camera or its program stand still? Leave '
            'them out'
        )


def remarks_about_cells(
    rig: Rig, maps: ConcentrationMaps, chosen: Sequence[int]
) -> Iterator[Remark]:
    """Yield a remark if single cells of the `chosen` maps are far off all others."""
    wells = cells_near(rig.wells.values(), maps.grid)
    found = np.concatenate([np.argwhere(false_cells(maps[index], wells)) for index in chosen])
    if len(found):
        row, column = found[0]
        yield remark_about_maps(
            f'{len(found)} cells in {len(chosen)} maps that were looked at are far above stock, or '
            f'unlike all their neighbours, the first at x = {maps.grid.x[column]:.3g} m, '
            f'z = {maps.grid.z[row]:.3g} m; look for a glare or a dead pixel. They count as unseen'
        )


def remarks_about_clean_sand(maps: ConcentrationMaps) -> Iterator[Remark]:
    """Yield a remark if the first map, clean in most places, is not zero there."""
    first = maps[0]
    level = float(np.nanmedian(first)) if np.isfinite(first).any() else 0.0
    if abs(level) > MOST_OFFSET and np.nanquantile(first, TRACER_QUANTILE) < VISIBLE_TRACER:
        yield remark_about_maps(
            f'the first map shows {level:.2g} nearly everywhere, where water is 0; subtract it, or '
            'take a clean baseline'
        )
