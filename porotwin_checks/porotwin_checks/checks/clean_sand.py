"""Is clean sand zero? The first map is clean in most places, because a plume begins small."""

from collections.abc import Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.model.tracer_share import PLUME_THRESHOLD

MOST_OFFSET = 0.03
"""Concentration [-] of clean sand that is odd; light and shake leave less."""

CLEAN_QUANTILE = 0.9
"""Share of the first map that is clean at least."""


def _find(known: Known) -> Iterator[Remark]:
    assert known.maps is not None
    first = known.maps[0]
    level = float(np.nanmedian(first)) if np.isfinite(first).any() else 0.0
    if abs(level) > MOST_OFFSET and np.nanquantile(first, CLEAN_QUANTILE) < PLUME_THRESHOLD:
        yield Remark.of(
            'maps',
            '',
            'the first map shows {level:.2g} nearly everywhere, where water is 0; subtract it, or '
            'take a clean baseline',
            level=level,
        )


CHECK = Check(needs=('maps',), find=_find)
