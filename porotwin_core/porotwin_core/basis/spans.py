"""Spans of time, such as pauses."""

import bisect
import math
from collections.abc import Sequence


def is_within(time: float, spans: Sequence[tuple[float, float]]) -> bool:
    """Return whether a `time` lies in one of the `spans`, each with its start and without its end.

    The spans are in order and do not overlap; a plan may have thousands.
    """
    begun = bisect.bisect_right(spans, (time, math.inf))
    return begun > 0 and time < spans[begun - 1][1]
