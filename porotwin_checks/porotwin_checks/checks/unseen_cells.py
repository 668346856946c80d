"""Do the maps show the rig? Empty maps, and cells that no map shows."""

from collections.abc import Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark

MOST_UNSEEN = 0.25
"""Largest usual share of cells without any map."""


def _find(known: Known) -> Iterator[Remark]:
    assert known.maps is not None
    ever_seen = np.zeros(known.grid.shape, dtype=bool)
    empty = []
    for time, values in zip(known.times, known.maps, strict=True):
        seen = np.isfinite(values)
        ever_seen |= seen
        if not seen.any():
            empty.append(float(time))
    if not ever_seen.any():
        yield Remark.of('maps', 'no_values', 'every value is missing (NaN); write the maps again')
        return
    if empty:
        yield Remark.of(
            'maps',
            'empty_maps',
            '{count} of {maps} maps hold no value (NaN everywhere), the first at {time_s:g} s; '
            'make them again, or leave them out',
            count=len(empty),
            maps=len(known.times),
            time_s=empty[0],
        )
    unseen = 1.0 - float(ever_seen.mean())
    if unseen > MOST_UNSEEN:
        yield Remark.of(
            'maps',
            'unseen_cells',
            '{share:.0%} of the cells have no value (NaN) in any map; was something before the '
            'rig? Nothing there is judged',
            share=unseen,
        )


CHECK = Check(needs=('maps',), find=_find)
