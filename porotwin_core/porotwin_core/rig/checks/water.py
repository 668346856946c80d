"""Do canals lie in the sand, with believable heads and rates, and no well in them?"""

from collections.abc import Iterator

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import rate_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.polygons import inside
from porotwin_core.rig.checks.heads import MOST_GRADIENT, STEEP
from porotwin_core.rig.description import Rig
from porotwin_core.rig.outlines import outline_remarks


def _water(rig: Rig) -> Iterator[Remark]:
    """Yield remarks about canals outside the sand, wells in them, heads far apart, and rates."""
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


CHECK = Check(find=_water)
