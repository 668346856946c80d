"""Does water reach every well?"""

from collections.abc import Iterator

from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

TIGHT = 1e-3
"""Permeability at a well over the greatest of the rig below which the well pumps next to nothing.
"""


def _tight_wells(rig: Rig) -> Iterator[Remark]:
    """Yield a remark about every well whose disc lies in hardly permeable sand alone."""
    permeability = rig.nominal_map('permeability_m2')
    if isinstance(permeability, float):
        return
    most = float(permeability.max())
    rows, columns = permeability.shape
    for name, well in rig.wells.items():
        high = _squares(well.z_m, well.radius_m, rig.height_m, rows)
        wide = _squares(well.x_m, well.radius_m, rig.width_m, columns)
        here = float(permeability[high, wide].max())
        if here < TIGHT * most:
            sands = [f" '{sand}'" for sand in rig.sands if rig.permeability_of_sand(sand) == here]
            yield Remark(
                f'wells.{name}',
                f'({well.x_m:g}, {well.z_m:g}) m',
                f'the sand{"".join(sands[:1])} there has {here:.2g} m2, the most permeable one '
                f'{most:.2g} m2, so that hardly any water reaches the well',
                'move it into permeable sand, or correct this permeability and its unit',
            )


def _squares(place: float, radius: float, size: float, count: int) -> slice:
    """Return the squares of a side of `size` [m] in `count` that a disc at `place` reaches."""
    first, last = (int(edge / size * count) for edge in (place - radius, place + radius))
    return slice(max(first, 0), last + 1)


CHECK = Check(find=_tight_wells)
