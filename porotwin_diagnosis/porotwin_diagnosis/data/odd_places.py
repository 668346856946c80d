"""Oddities of the places of tracer: maps that are turned, and rates of the wrong sign."""

from collections.abc import Callable, Generator, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.plausibility import Remark
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.false_cells import cells_near
from porotwin_diagnosis.data.odd_maps import remark_about_maps
from porotwin_recording.tables.concentration import ConcentrationMaps

PURE = 0.5
"""Concentration [-] of injected fluid from which on its well is surely seen in the maps."""

EMPTY_LEVEL, FULL_LEVEL = 0.25, 0.5
"""Mean concentrations [-] around a well without tracer at most, and with tracer at least."""

EARLY_MAPS = 4
"""First maps of an injection that are looked at by themselves."""

TURNS: dict[str, Callable[[NDArray[np.bool_]], NDArray[np.bool_]]] = {
    '': lambda cells: cells,
    'upside down': lambda cells: cells[::-1],
    'swapped left and right': lambda cells: cells[:, ::-1],
    'turned by 180 degrees': lambda cells: cells[::-1, ::-1],
}
"""Ways to turn a map (nz, nx), by their names."""


def remarks_about_places(
    rig: Rig, maps: ConcentrationMaps, rates: Schedule, chosen: Sequence[int]
) -> Iterator[Remark]:
    """Yield a remark if tracer lies elsewhere than at the wells that inject it.

    It lies at the wells that take water out if the signs of the rates are exchanged. It lies at
    mirror images if the maps are turned: a file of rows from the top down is upside down, since z
    points up.
    """
    if not (yield from _remarks_by_maps(rig, maps, rates, chosen)):
        yield from _remarks_by_maps(rig, maps, rates, _early(maps, rates))


def _early(maps: ConcentrationMaps, rates: Schedule) -> Sequence[int]:
    """Return the first maps after stock begins to flow: a later plume may cover all of the rig."""
    stock = [row.time for row in rates.rows if row.rate.rate > 0 and row.rate.concentration > PURE]
    return np.flatnonzero(maps.times > min(stock, default=np.inf))[:EARLY_MAPS].tolist()


def _remarks_by_maps(
    rig: Rig, maps: ConcentrationMaps, rates: Schedule, chosen: Sequence[int]
) -> Generator[Remark, None, bool]:
    """Yield a remark by the `chosen` maps; return whether there was one."""
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
        return False
    means = {how: float(np.mean(found)) for how, found in injecting.items()}
    if means[''] >= EMPTY_LEVEL:
        return False
    turned = max(means, key=means.__getitem__)
    where_they_inject = f'where wells inject stock they show {means[""]:.2g} in the mean'
    mirrored = f'the maps seem to be {turned}: ' if means[turned] > FULL_LEVEL else ''
    if taking and np.mean(taking) > FULL_LEVEL:
        either = f', or the maps to be {turned}' if mirrored else ''
        yield remark_about_maps(
            f'the rates seem to have the wrong sign{either}: {where_they_inject}, and '
            f'{np.mean(taking):.2g} where wells take water out; a positive rate injects. Or two '
            "wells have each other's place in rig.yaml"
        )
    elif mirrored:
        yield remark_about_maps(
            f'{mirrored}{where_they_inject}, and {means[turned]:.2g} at their '
            'mirror images; turn the maps, whose rows go from the bottom up and whose columns from '
            'left to right, or correct the places of the wells in rig.yaml'
        )
    else:
        return False
    return True


def _levels(frame: FloatArray, cells: NDArray[np.bool_]) -> list[float]:
    """Return the known values of a map (nz, nx) in some cells."""
    seen = frame[cells]
    found: list[float] = seen[np.isfinite(seen)].tolist()
    return found
