"""Does the coarse grid of plans and siblings keep the barriers of the rig closed?"""

from collections.abc import Iterator
from dataclasses import replace

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.coarse_grid import coarse_grid
from porotwin_core.rig.grid_oddities import remarks_about_barriers

REMEDY = 'trust no forecast across it; a barrier as wide as two cells is closed'


def _find(known: Known) -> Iterator[Remark]:
    coarse = coarse_grid(known.rig, known.cells)
    if known.rig.control is not None and coarse != known.cells:
        for remark in remarks_about_barriers(coarse, known.rig):
            yield replace(remark, key='grid of plans and siblings', remedy=REMEDY)


CHECK = Check(needs=('rig',), find=_find)
