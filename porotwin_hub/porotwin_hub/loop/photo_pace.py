"""Whether photographs come as often as the twin was told."""

import statistics
from collections.abc import Sequence
from itertools import pairwise

FEWEST = 4
"""Photographs that tell a pace."""

FACTOR = 1.5
"""A pace that differs by less is no other pace: a photograph may be lost or late."""


def odd_pace(times: Sequence[float], interval: float) -> str:
    """Return that photographs come at another pace than told, in words, or an empty string.

    Args:
        times: of the last photographs [s], in their order.
        interval: time between photographs that the twin was told [s].
    """
    if len(times) < FEWEST:
        return ''
    usual = statistics.median(later - earlier for earlier, later in pairwise(times))
    if interval / FACTOR < usual < interval * FACTOR:
        return ''
    return (
        f'photographs come every {usual:.3g} s, but the twin expects one every {interval:g} s; '
        f'start it with --photo-interval-s {usual:.3g}'
    )
