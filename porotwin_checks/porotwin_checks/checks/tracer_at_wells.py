"""Is a well that injects tracer full of it?

Tracer that a baseline shows already is not seen in later photographs. The plume then has a hole,
and the hole is at the well. The tracer lies at mirror images of the wells if the maps are turned: a
file of rows from the top down is upside down, since z points up. It lies at the wells that take
water out if the signs of the rates are exchanged.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_checks.known import Known
from porotwin_checks.near_wells import cells_near
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.rates.wells import Schedule
from porotwin_solver.effects import tracer_storage

LEAST_AT_WELL = 0.5
"""Least concentration at a well relative to its injected one; below it the maps must be wrong [-].
Calibrated maps are right within a tenth there."""

PERCENTILE = 90.0
"""Percentile of the cells near a well that counts: a stream that leaves it in a flow is narrow."""

FILLINGS = 2.0
"""A well counts when it has moved this many times the pores of these cells [-]."""

SAME_FLUID = 0.02
"""Injected concentrations that differ by less are the same fluid [-]."""

EARLY_MAPS = 4
"""First maps of an injection that are looked at by themselves: later plumes may cover the rig."""

TURNS: dict[str, Callable[[NDArray[Any]], NDArray[Any]]] = {
    '': lambda values: values,
    'upside down': lambda values: values[::-1],
    'swapped left and right': lambda values: values[:, ::-1],
    'turned by 180 degrees': lambda values: values[::-1, ::-1],
}
"""Ways to turn a map (nz, nx), by their names."""

EXCHANGED = 'x_m and z_m exchanged'
"""Name of the place of a well whose x_m and z_m are exchanged, beside the `TURNS`."""

HIDDEN = (
    'the maps hide well {well} while it injects tracer; is it covered, or has the tracer another '
    'colour than in the calibration? Calibrate with this dye'
)
PALE = (
    'the maps show {share:.0%} of the tracer at well {well} while it injects: the baseline shows '
    'tracer already, or the rates are wrong; take a baseline from before any tracer, and check the '
    'rates, the place of the well, the clock of the camera and camera.corners_px'
)
TURNED = (
    'the maps seem to be {turned}: they show {share:.0%} of the tracer at well {well} while it '
    'injects, and {mirrored:.0%} at its mirror image; turn the maps, whose rows go from the bottom '
    'up and whose columns from left to right, or correct the places of the wells in rig.yaml'
)
PLACE = (
    'the maps show {share:.0%} of the tracer at well {well} while it injects, and {mirrored:.0%} '
    'where it stands with {turned}; exchange them in rig.yaml'
)
SIGN = (
    'the rates seem to have the wrong sign: the maps show {share:.0%} of the tracer at well {well} '
    'while it injects, and {taken:.0%} where wells take water out; a positive rate injects. Or the '
    "maps are turned, or two wells have each other's place in rig.yaml"
)


def _find(known: Known) -> Iterator[Remark]:
    """Yield the remark about the first well without its tracer.

    Half of the maps of a well must show it: a clock or a tube may delay the first tracer. A well
    that no map shows is masked, and not judged.
    """
    assert known.rates is not None
    rows = known.rates.rows
    begin = min(
        (row.time for row in rows if row.rate.rate > 0.0 and row.rate.concentration > 0.0),
        default=math.inf,
    )
    early = np.flatnonzero(np.asarray(known.times) > begin)[:EARLY_MAPS].tolist()
    found = pale_well(known, known.looked_at)
    if found is None:
        found = pale_well(known, early)
        if found is not None and found.code not in (
            'turned_maps',
            'turned_sign',
            'exchanged_place',
        ):
            return
    if found is not None:
        yield found


def pale_well(known: Known, numbers: Sequence[int]) -> Remark | None:
    """Return the remark about the first well without its tracer by some of the maps; None if none.

    Args:
        known: its rig, rates and maps.
        numbers: of the maps.
    """
    maps, rates, grid = known.maps, known.rates, known.grid
    assert maps is not None and rates is not None
    pores = tracer_storage(known.rig, grid)
    near = {name: cells_near([well], grid) for name, well in known.rig.wells.items()}
    exchanged = {
        name: cells_near([well.model_copy(update={'x_m': well.z_m, 'z_m': well.x_m})], grid)
        for name, well in known.rig.wells.items()
        if well.z_m < known.rig.width_m and well.x_m < known.rig.height_m
    }
    shares: dict[str, dict[str, list[float]]] = {}
    taken: list[float] = []
    uncovered: set[str] = set()
    for number in numbers:
        values, time = maps[number], float(known.times[number])
        for well, cells in near.items():
            if np.isfinite(values[cells]).any():
                uncovered.add(well)
            volume, concentration = _same_fluid(rates, well, time)
            if abs(volume) <= FILLINGS * float(pores[cells].sum()):
                continue
            if volume < 0.0:
                taken.append(_level(values[cells]))
            elif concentration > 0.0:
                seen = shares.setdefault(well, {turned: [] for turned in (*TURNS, EXCHANGED)})
                for turned, turn in TURNS.items():
                    seen[turned].append(_level(turn(values)[cells]) / concentration)
                if well in exchanged:
                    seen[EXCHANGED].append(_level(values[exchanged[well]]) / concentration)
    for well in (well for well in shares if well in uncovered):
        hidden = int(np.isnan(shares[well]['']).sum())
        if 2 * hidden > len(shares[well]['']):
            return Remark.of('maps', 'hidden_well', HIDDEN, well=well)
        levels = {turned: _median(found) for turned, found in shares[well].items()}
        share = max(levels.pop(''), 0.0)
        if share >= LEAST_AT_WELL:
            continue
        turned = max(levels, key=levels.__getitem__)
        facts = {'well': well, 'share': share, 'mirrored': levels[turned], 'turned': turned}
        if _median(taken) > LEAST_AT_WELL:
            return Remark.of('maps', 'turned_sign', SIGN, taken=_median(taken), **facts)
        code, words = ('pale_well', PALE)
        if levels[turned] > LEAST_AT_WELL:
            told = {EXCHANGED: ('exchanged_place', PLACE)}
            code, words = told.get(turned, ('turned_maps', TURNED))
        return Remark.of('maps', code, words, **facts)
    return None


def _level(near: NDArray[Any]) -> float:
    """Return the concentration that counts in cells [-]; NaN if all are hidden."""
    return float(np.nanpercentile(near, PERCENTILE)) if np.isfinite(near).any() else math.nan


def _median(levels: Sequence[float]) -> float:
    """Return the median of the known levels; 0 without any."""
    known = [level for level in levels if math.isfinite(level)]
    return float(np.median(known)) if known else 0.0


def _same_fluid(schedule: Schedule, well: str, until: float) -> tuple[float, float]:
    """Return volume [m^3] and concentration [-] of the fluid that a well injects at `until` [s].

    Only fluid since the last pause, change of sign or change of concentration counts. Water that
    the well takes out is negative.
    """
    rows = [row for row in schedule.rows if row.well == well and row.time < until]
    ends = [*(row.time for row in rows[1:]), until]
    volume = concentration = 0.0
    for row, end in zip(rows, ends, strict=False):  # without rows there is one end
        rate = row.rate.rate
        other_fluid = rate > 0.0 and abs(row.rate.concentration - concentration) > SAME_FLUID
        if rate * volume <= 0.0 or other_fluid:
            volume, concentration = 0.0, row.rate.concentration
        volume += (end - row.time) * rate
    return volume, concentration


CHECK = Check(
    needs=('scaled_maps', 'rates'),
    find=_find,
    explained_by=(
        'no_values', 'no_stock', 'no_tracer',
        'inverted_maps', 'reversed_maps', 'late_or_used', 'earlier_tracer', 'late_baseline',
    ),
)  # fmt: skip
