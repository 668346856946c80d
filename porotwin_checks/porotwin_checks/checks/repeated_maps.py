"""Does a map repeat another one? Their noise always differs, unless a camera stands still."""

import hashlib
from collections.abc import Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark


def _find(known: Known) -> Iterator[Remark]:
    """Yield a remark if maps are equal to the last bit; those without any tracer may be."""
    assert known.maps is not None
    first: dict[bytes, float] = {}
    same = []
    for time, values in zip(known.times, known.maps, strict=True):
        if not np.nan_to_num(values).any():
            continue
        digest = hashlib.sha256(values.tobytes()).digest()
        if digest in first:
            same.append((time, first[digest]))
        first.setdefault(digest, time)
    if same:
        time, other = same[0]
        yield Remark.of(
            'maps',
            '',
            '{count} of {maps} maps repeat another one to the last bit, the first at {time_s:g} s '
            'that at {other_s:g} s; did the camera or its program stand still? Leave them out',
            count=len(same),
            maps=len(known.times),
            time_s=time,
            other_s=other,
        )


CHECK = Check(needs=('maps',), find=_find)
