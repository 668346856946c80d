"""Has every sand a place, and the numbers of sand or of a barrier?"""

from collections.abc import Iterator

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import CONDUCTIVITY, PERMEABILITY, POROSITY, PlausibleRange
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig
from porotwin_core.rig.grid_oddities import SEALING
from porotwin_core.rig.outlines import outline_remarks
from porotwin_core.rig.sand_drawing import sand_raster


def _sands(rig: Rig) -> Iterator[Remark]:
    for name, sand in rig.sands.items():
        yield from POROSITY.remarks(f'sands.{name}.porosity', sand.porosity)
    yield from _conducting(rig, PERMEABILITY, 'permeability_m2')
    yield from _conducting(rig, CONDUCTIVITY, 'hydraulic_conductivity_m_s')
    for number, layer in enumerate(rig.sand_layers[:-1], start=1):
        heights = [z for _, z in layer.top_m] if isinstance(layer.top_m, tuple) else [layer.top_m]
        if max(z for z in heights if z is not None) > rig.height_m:
            yield Remark(
                f'sand_layers.{number}.top_m',
                f'{max(z for z in heights if z is not None):g} m',
                f'the rig ends at {rig.height_m:g} m',
                'compare the heights with height_m, both in m',
            )
    for number, polygon in enumerate(rig.sand_polygons, start=1):
        yield from outline_remarks(rig, f'sand_polygons.{number}.corners_m', polygon.corners_m)
    yield from _unused_sands(rig)


def _conducting(rig: Rig, plausible: PlausibleRange, key: str) -> Iterator[Remark]:
    """Yield remarks about the `key` of sands: a barrier beside other sand is refused or right."""
    values = {name: getattr(sand, key) for name, sand in rig.sands.items()}
    given = {name: value for name, value in values.items() if value is not None}
    for name, value in given.items():
        is_barrier = value < SEALING * max(given.values())
        for remark in plausible.remarks(f'sands.{name}.{key}', value):
            if remark.refused or not is_barrier:
                yield remark


def _unused_sands(rig: Rig) -> Iterator[Remark]:
    porosity, permeability = rig.nominal_map('porosity'), rig.nominal_map('permeability_m2')
    for name, sand in rig.sands.items():
        if name not in rig.placed_sands:
            yield Remark(f'sands.{name}', '', 'this sand has no place', 'place or remove it')
        elif not np.any(
            (porosity == sand.porosity) & (permeability == rig.permeability_of_sand(name))
        ):
            squares = sand_raster(rig.width_m, rig.height_m)
            width = f'{1e3 * squares.dx:.2g} mm'
            why = f'it fills no square of the drawn rig; squares are {width} wide'
            yield Remark(f'sands.{name}', '', why, f'make it at least {width} thick, or remove it')


CHECK = Check(find=_sands)
