"""Is the rig flat, as the model assumes?"""

from collections.abc import Iterator

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

DEEP = 0.5
"""Depth over the smaller side above which a rig is no longer flat, as the model assumes."""


def _shape(rig: Rig) -> Iterator[Remark]:
    depth = float(np.max(rig.nominal_map('depth_m')))
    if depth > DEEP * min(rig.width_m, rig.height_m):
        yield Remark(
            'depth_m',
            f'{depth:g} m',
            f'the model is flat, but the rig of {rig.width_m:g} m x {rig.height_m:g} m is not',
            'compare the three lengths and their units',
        )


CHECK = Check(find=_shape)
