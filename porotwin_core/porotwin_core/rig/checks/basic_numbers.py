"""Do the numbers fit water and sand, in the right unit?

Its name puts it first: a wrong unit here makes other values odd as well.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import (
    CONDUCTIVITY,
    DENSITY,
    DEPTH,
    PERMEABILITY,
    POROSITY,
    VISCOSITY,
    WIDTH,
)
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig


def _extremes(value: Any) -> tuple[float, ...]:
    return tuple({float(np.min(value)), float(np.max(value))})


def _numbers(rig: Rig) -> Iterator[Remark]:
    yield from WIDTH.remarks('width_m', rig.width_m)
    yield from WIDTH.remarks('height_m', rig.height_m)
    yield from DEPTH.remarks('depth_m', *_extremes(rig.nominal_map('depth_m')))
    yield from VISCOSITY.remarks('viscosity_pa_s', rig.viscosity_pa_s)
    yield from DENSITY.remarks('density_kg_m3', rig.density_kg_m3)
    if rig.hydraulic_conductivity_m_s is not None:
        key = 'hydraulic_conductivity_m_s'
        yield from CONDUCTIVITY.remarks(key, rig.hydraulic_conductivity_m_s)
    elif not rig.sands:
        permeability = _extremes(rig.nominal_map('permeability_m2'))
        yield from PERMEABILITY.remarks('permeability_m2', *permeability)
    if not rig.sands:
        yield from POROSITY.remarks('porosity', *_extremes(rig.nominal_map('porosity')))


CHECK = Check(find=_numbers)
