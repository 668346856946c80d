"""A check of the corners of a rig: corners from a smaller copy lie close together."""

from collections.abc import Sequence

import numpy as np

from porotwin_core.units import percent

SMALL_IN_PHOTOGRAPH = 0.1
"""Part of a photograph below which the rig is suspiciously small in it."""

HALF = 0.52
"""Corners of a copy of half the size lie within this share of width and height: a little more than
half, because corners of a rig may lie just outside the photograph."""

REMEDY = 'were they read in a copy of another size? correct them'


def small_rig(corners: Sequence[tuple[float, float]], size: tuple[int, int]) -> str:
    """Return a remark about a rig of small size in its photograph; '' for other rigs.

    Args:
        corners: columns and rows of the corners [px].
        size: width and height of the photograph [px].
    """
    places = np.array(corners) / np.array(size)
    part = float(np.prod(np.ptp(places, axis=0)))
    in_one_half = (places <= HALF).all(axis=0) | (places >= 1.0 - HALF).all(axis=0)
    quarter = ', all in one quarter of it' if in_one_half.all() else ''
    if part >= SMALL_IN_PHOTOGRAPH and not quarter:
        return ''
    return f'the rig covers {percent(part)} of the photograph of {size[0]} x {size[1]} px{quarter}'
