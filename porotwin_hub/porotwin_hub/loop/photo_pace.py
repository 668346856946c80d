"""Whether photographs come as often as the twin was told."""

import statistics
from collections.abc import Sequence
from itertools import pairwise

from porotwin_core.basis.remark import Remark
from porotwin_core.clock.freshness import LEARNING_PHOTOGRAPHS

FACTOR = 1.5
"""A pace that differs by less is no other pace: a photograph may be lost or late."""


PACE = (
    'one comes every {usual_s:.3g} s, but the twin expects one every {expected_s:g} s; start it '
    'with --photo-interval-s {usual_s:.3g}'
)


def odd_pace(times: Sequence[float], interval: float) -> Remark | None:
    """Return the remark that photographs come at another pace than told; None if they do not.

    Args:
        times: of the last photographs [s], in their order.
        interval: time between photographs that the twin was told [s].
    """
    if len(times) < LEARNING_PHOTOGRAPHS:
        return None
    usual = statistics.median(later - earlier for earlier, later in pairwise(times))
    if interval / FACTOR < usual < interval * FACTOR:
        return None
    return Remark.of('photographs', 'odd_pace', PACE, usual_s=usual, expected_s=interval)
