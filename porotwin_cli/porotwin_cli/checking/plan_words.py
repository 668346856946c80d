"""The places of wells and their plan in words, to compare with the protocol."""

import numpy as np

from porotwin_core.basis.units import MINUTE_S, ML
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig

HEIGHTS, SIDES = ('lower', 'middle', 'upper'), ('left', 'middle', 'right')


def place_words(rig: Rig) -> str:
    """Return one line: the part of the rig of every well and canal, and its sand."""
    told = []
    for name, well in rig.wells.items():
        sand = _sand_at(rig, well.x_m, well.z_m)
        told.append(f'{name} {_part(rig, well.x_m, well.z_m)}{f" in {sand}" if sand else ""}')
    for name, body in rig.water.items():
        if body.corners_m is not None:
            x, z = np.mean(body.corners_m, axis=0)
            told.append(f'{name} {_part(rig, x, z)}')
    return f'places: {", ".join(told)}'


def plan_words(rates: Schedule, into_sand: Schedule, end: float) -> str:
    """Return one line: when the `rates` change until `end` [s], and the volume of each well.

    The rates `into_sand` tell the volumes.
    """
    volumes = dict.fromkeys(rates.wells, 0.0)
    for low, high, held in into_sand.intervals(0.0, end):
        for well, one in held.items():
            volumes[well] += (high - low) * one.rate
    changes, before = [], rates.at(0.0)
    for low, _, _ in rates.intervals(0.0, end):
        if (now := rates.at(low)) != before:
            changes.append(low)
        before = now
    when = 'rates do not change'
    if changes:
        first, last = (f'{time / MINUTE_S:.4g}' for time in (changes[0], changes[-1]))
        when = f'rates change {len(changes)} times, first at {first} min, last at {last} min'
    each = ', '.join(f'{well} {ML * volume:+.4g} ml' for well, volume in volumes.items() if volume)
    return f'{when}; into the sand until {end / MINUTE_S:.4g} min {each}'


def _part(rig: Rig, x: float, z: float) -> str:
    """Return the third of the height and of the width of a place, in words."""
    shares = (z / rig.height_m, x / rig.width_m)
    words = [
        names[min(int(share * len(names)), len(names) - 1)]
        for names, share in zip((HEIGHTS, SIDES), shares, strict=True)
    ]
    return ' '.join(dict.fromkeys(words))


def _sand_at(rig: Rig, x: float, z: float) -> str:
    """Return the sand at a place; empty where the rig has no kinds of sand."""
    for name in rig.sands:
        here = np.atleast_2d(rig.is_of_sand(name))
        rows, columns = here.shape
        row = min(int(z / rig.height_m * rows), rows - 1)
        if here[row, min(int(x / rig.width_m * columns), columns - 1)]:
            return name
    return ''
