"""Do the wells lie in the sand, each at a place and with a name of its own?"""

import functools
import itertools
import math
import unicodedata
from collections.abc import Iterator
from typing import Any

from porotwin_core.basis.check import Check
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.plausibility import WELL_RADIUS
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

LARGE_WELL = 0.1
"""Radius of a well over the smaller side of the rig above which it is odd."""


def _wells(rig: Rig) -> Iterator[Remark]:
    if not rig.wells and not rig.is_driven:
        yield Remark('wells', '{}', 'no water can be pumped', 'name the wells, each with x_m, z_m')
    smaller = min(rig.width_m, rig.height_m)
    for name, well in rig.wells.items():
        key = f'wells.{name}.radius_m'
        radius = well.radius_m
        yield from WELL_RADIUS.remarks(key, radius)
        room = min(well.x_m, rig.width_m - well.x_m, well.z_m, rig.height_m - well.z_m)
        if radius > LARGE_WELL * smaller:
            why = f'a tenth of the rig is {LARGE_WELL * smaller:g} m'
            yield Remark(key, f'{radius:g} m', why, 'give the radius of the tube in m')
        elif room < radius:
            place = f'({well.x_m:g}, {well.z_m:g}) m'
            why = f'its disc of {radius:g} m reaches into the wall {room:g} m away'
            yield Remark(f'wells.{name}', place, why, 'move it into the sand or reduce radius_m')
    for (one, first), (other, second) in itertools.combinations(rig.wells.items(), 2):
        yield from _pair(one, first, other, second)


def _pair(one: str, first: Any, other: str, second: Any) -> Iterator[Remark]:
    if _plain(one) == _plain(other):
        why = 'the two names look the same: they differ by capital letters, spaces or coding only'
        yield Remark(f'wells.{other}', '', f'{why}, as in {one}', 'rename one of them')
    distance = math.hypot(first.x_m - second.x_m, first.z_m - second.z_m)
    if distance < first.radius_m + second.radius_m:
        same = distance < WRITTEN_ROUND_OFF
        yield Remark(
            f'wells.{other}',
            f'({second.x_m:g}, {second.z_m:g}) m',
            f"it {'stands at the same place as' if same else 'overlaps'} '{one}'",
            'correct one place, or make one well of both',
            refused=same,
        )


@functools.cache
def _plain(name: str) -> str:
    """Return a name as a person reads it: small, usual letters, each accent with its letter."""
    return ' '.join(unicodedata.normalize('NFKC', name).lower().split())


CHECK = Check(find=_wells)
