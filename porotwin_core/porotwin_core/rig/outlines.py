"""Whether an outline that a description gives lies in the rig."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.polygons import crosses_itself, inside
from porotwin_core.rig.description import Rig
from porotwin_core.rig.sections import LEAST_CORNERS

IN_ZONE_SAMPLES = 200
"""Places along each side of the rig, for the search of a zone."""


def outline_remarks(rig: Rig, key: str, corners: Any) -> Iterator[Remark]:
    """Yield the remarks about a polygon (x, z) [m] that should lie in the rig."""
    try:
        polygon = np.array(corners, dtype=float).reshape(-1, 2)
    except (TypeError, ValueError):
        return  # the reader of the parameter refuses it
    if len(polygon) < LEAST_CORNERS:
        return
    size = f'the rig of {rig.width_m:g} m x {rig.height_m:g} m'
    if crosses_itself(polygon):
        why = 'the outline crosses itself'
        yield Remark(key, '', why, 'give the corners in their order round the zone', refused=True)
        return
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    extent = f'{low[0]:g} to {high[0]:g} m in x, {low[1]:g} to {high[1]:g} m in z'
    within = (low >= 0.0).all() and (high <= np.array([rig.width_m, rig.height_m])).all()
    if not _covers(rig, polygon):
        why = f'it covers nothing of {size}'
        remedy = 'give the corners (x, z) in m from the lower left corner'
        if within:
            why, remedy = f'it is too thin to cover a place of {size}', 'make it thicker'
        yield Remark(key, extent, why, remedy, refused=True)
    elif (high > 1.02 * np.array([rig.width_m, rig.height_m])).any() or (low < -0.02).any():
        yield Remark(key, extent, f'it reaches beyond {size}', 'correct it if that is a slip')


def _covers(rig: Rig, polygon: Any) -> bool:
    samples = (np.arange(IN_ZONE_SAMPLES) + 0.5) / IN_ZONE_SAMPLES
    x, z = np.meshgrid(samples * rig.width_m, samples * rig.height_m)
    return bool(inside(np.column_stack([x.ravel(), z.ravel()]), polygon).any())
