"""Do canals lie in the sand, with believable heads and rates, and no well in them?"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import rate_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.polygons import inside
from porotwin_core.rig.checks.heads import MOST_GRADIENT, STEEP
from porotwin_core.rig.description import Rig
from porotwin_core.rig.outlines import outline_remarks
from porotwin_core.rig.sand_drawing import sand_raster
from porotwin_core.rig.sections import WaterBody


def _water(rig: Rig) -> Iterator[Remark]:
    """Yield remarks about canals outside the sand, wells in them, their levels, and rates."""
    heads = {name: b.head_m for name, b in rig.water_bodies.items() if b.head_m is not None}
    if rig.water and heads:
        low, high = min(heads, key=heads.__getitem__), max(heads, key=heads.__getitem__)
        apart, size = heads[high] - heads[low], max(rig.width_m, rig.height_m)
        if apart > STEEP * size:
            why = f"it is {apart:g} m higher than '{low}', in a rig of {size:g} m"
            far = apart > MOST_GRADIENT * size
            shown = f'{heads[high]:g} m'
            yield Remark(f'water.{high}.head_m', shown, why, 'is it in cm? write m', refused=far)
    for name, body in rig.water.items():
        key = f'water.{name}'
        remark = rate_remark(f'{key}.rate_ml_h', body.rate_ml_h or 0.0, rig.pore_volume)
        if body.rate_ml_h and remark is not None:
            yield remark
        if body.corners_m is None:
            continue
        yield from outline_remarks(rig, f'{key}.corners_m', body.corners_m)
        wells = np.array([(well.x_m, well.z_m) for well in rig.wells.values()]).reshape(-1, 2)
        for well, within in zip(rig.wells, inside(wells, np.array(body.corners_m)), strict=True):
            if within:
                why = f"it lies in the open water '{name}'"
                yield Remark(f'wells.{well}', '', why, 'move it into the sand', refused=True)

    yield from _exchanged_heads(rig)
    if rig.water or rig.water_table:  # only then are heads heights above the lower edge
        for name, body in rig.water_bodies.items():
            yield from _missed_level(rig, name, body)
            yield from _level_at_side(rig, name, body)
    if rig.water_table and rig.water_table.fringe_m > rig.height_m:
        why = f'the whole rig is {rig.height_m:g} m high, so that no sand is dry'
        shown = f'{rig.water_table.fringe_m:g} m'
        yield Remark('water_table.fringe_m', shown, why, 'is it in cm or mm? write m')
    if rig.water_table and heads:
        yield from _dry_wells(rig, max(heads.values()) + rig.water_table.fringe_m)


def _exchanged_heads(rig: Rig) -> Iterator[Remark]:
    """Yield a remark about two drawn canals if each reaches the other's level rather than its own.

    A canal that is drawn above its level is right: its wall shows in photographs.
    """
    square = sand_raster(rig.width_m, rig.height_m).dz
    drawn = [
        (max(z for _, z in body.corners_m), body.head_m, name)
        for name, body in rig.water.items()
        if body.corners_m is not None and body.head_m is not None
    ]
    for (top, head, name), (other_top, other_head, other) in combinations(drawn, 2):
        off = abs(top - head) + abs(other_top - other_head)
        if abs(top - other_head) + abs(other_top - head) + square < off:
            why = f"it is drawn up to {top:g} m, and '{other}' up to {other_top:g} m"
            remedy = f'were their heads exchanged? {other} has {other_head:g} m'
            yield Remark(_head_key(rig, name), f'{head:g} m', why, remedy)


def _levels(rig: Rig, name: str, head: float) -> list[float]:
    """Return the `head` [m] at the start and all later levels of the water `name`."""
    course = rig.levels.get(name)
    return [head, *(level for _, level in course.points)] if course else [head]


def _level_at_side(rig: Rig, name: str, body: WaterBody) -> Iterator[Remark]:
    """Yield a remark about a side that reaches above the level of its water."""
    if body.side is None or body.head_m is None:
        return
    upright = body.side in ('left', 'right')
    high = (body.to_m or rig.height_m) if upright else _foot(rig, body)
    if _foot(rig, body) <= body.head_m < high and rig.water_table is None:
        place = f'the {body.side} side reaches to {high:g} m'
        why = f'{place}, and the sand above the level counts as full'
        end = 'end it at the level (to_m)'
        if name not in rig.water:
            end = f'close this side, and describe it in water, with to_m: {body.head_m:g}'
        remedy = f'{end}, or give a water_table'
        yield Remark(_head_key(rig, name), f'{body.head_m:g} m', why, remedy)


def _head_key(rig: Rig, name: str) -> str:
    """Return the key of the head of the water `name`."""
    return f'water.{name}.head_m' if name in rig.water else f'boundaries.heads_m.{name}'


def _foot(rig: Rig, body: WaterBody) -> float:
    """Return the height [m] above the lower edge of the sand at which the water begins."""
    if body.corners_m is not None:
        return min(z for _, z in body.corners_m)
    if body.side in ('left', 'right'):
        return body.from_m
    return rig.height_m if body.side == 'top' else 0.0


def _missed_level(rig: Rig, name: str, body: WaterBody) -> Iterator[Remark]:
    """Yield remarks about water below its place or above its tank, at the start or later.

    A side may have a level above the tank, in a reservoir, unless a table lies in the sand.
    """
    if body.head_m is None:
        return
    levels, foot, top = _levels(rig, name, body.head_m), _foot(rig, body), rig.height_m
    place = 'open water' if body.side is None else f'{body.side} side'
    missed = {}
    if (lowest := min(levels)) < foot:
        missed[lowest] = f'stands below the {place}, which begins at {foot:g} m'
    if (highest := max(levels)) > top and (body.side is None or rig.water_table is not None):
        missed[highest] = f'would flow over: the rig is {top:g} m high'
    for level, why in missed.items():
        key = f'levels.{name}' if level != body.head_m else _head_key(rig, name)
        remedy = 'correct it, in m above the lower edge of the sand'
        yield Remark(key, f'{level:g} m', f'its water {why}', remedy)


def _dry_wells(rig: Rig, wet_m: float) -> Iterator[Remark]:
    """Yield a remark about every well that lies above all levels and the fringe, at `wet_m`."""
    for name, well in rig.wells.items():
        if well.z_m - well.radius_m > wet_m:
            why = f'no water level and its fringe reach above {wet_m:g} m, so that it lies dry'
            shown = f'({well.x_m:g}, {well.z_m:g}) m'
            yield Remark(f'wells.{name}', shown, why, 'correct its place or the heads')


CHECK = Check(find=_water)
