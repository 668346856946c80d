"""Is the rig flat, as the model assumes, and do its measured depths agree with each other?"""

from collections.abc import Iterator

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig
from porotwin_core.rig.sand_sections import DepthPoints

DEEP = 0.5
"""Depth over the smaller side above which a rig is no longer flat, as the model assumes."""

MOST_DEPTH_RATIO = 3.0
"""Measured depth over the median of all that is odd: plates bulge by a half at most."""

NEAR = 0.05
"""Distance of a place beyond the edge of the rig, over its size, that passes for a slip."""


def _measured_depths(rig: Rig) -> Iterator[Remark]:
    if not isinstance(rig.depth_m, DepthPoints):
        return
    places: dict[tuple[float, float], float] = {}
    for x, z, depth in rig.depth_m.points:
        place = f'({x:g}, {z:g}) m'
        if not (
            -NEAR * rig.width_m <= x <= (1 + NEAR) * rig.width_m
            and -NEAR * rig.height_m <= z <= (1 + NEAR) * rig.height_m
        ):
            size = f'the rig of {rig.width_m:g} m x {rig.height_m:g} m'
            yield Remark(
                'depth_m.points', place, f'it lies outside {size}', 'write x, z, depth in m'
            )
            return
        if places.setdefault((x, z), depth) != depth:
            yield Remark('depth_m.points', place, 'it has two depths', 'keep one of them')
            return
    middle = float(np.median(list(places.values())))
    for (x, z), depth in places.items():
        if not 1.0 / MOST_DEPTH_RATIO <= depth / middle <= MOST_DEPTH_RATIO:
            why = f'most points are about {middle:.3g} m deep'
            yield Remark('depth_m.points', f'{depth:g} m at ({x:g}, {z:g}) m', why, 'correct one')
            return


def _shape(rig: Rig) -> Iterator[Remark]:
    depth = float(np.max(rig.nominal_map('depth_m')))
    if depth > DEEP * min(rig.width_m, rig.height_m):
        yield Remark(
            'depth_m',
            f'{depth:g} m',
            f'the model is flat, but the rig of {rig.width_m:g} m x {rig.height_m:g} m is not',
            'compare the three lengths and their units',
        )


def _find(rig: Rig) -> Iterator[Remark]:
    yield from _measured_depths(rig)
    yield from _shape(rig)


CHECK = Check(find=_find)
