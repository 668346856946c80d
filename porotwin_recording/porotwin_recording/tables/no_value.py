"""Numbers that stand for no value in maps, and the words for their counts."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAST_CONCENTRATION, LARGEST_CONCENTRATION = -1.0, 1e6
"""Concentrations [-] beyond these are no measured values in any unit, but codes for none, such as
-1, -9999 or 1e20. Noise goes down to -0.3."""

LEAST_NOISE = 0.3
"""Concentration below 0 [-] that noise does not reach."""

Counts = dict[str, int]
"""Numbers of values that became NaN, by the reason."""


def without_codes(values: NDArray[Any], stock: float) -> tuple[NDArray[Any], Counts]:
    """Return concentrations with NaN in place of numbers that stand for no value.

    Such a number is beyond every concentration. Or it is far below zero and stands in several
    cells, which noise does not do.

    Args:
        values: the concentrations.
        stock: the value of the tracer stock.
    """
    if values.dtype.kind not in 'iuf':
        return values, {}
    with np.errstate(invalid='ignore'):
        far = (values < -LEAST_NOISE * stock) | (values > LARGEST_CONCENTRATION * stock)
    numbers, cells = np.unique(values[far], return_counts=True)
    impossible = (numbers <= LEAST_CONCENTRATION * stock) | (
        numbers > LARGEST_CONCENTRATION * stock
    )
    codes = impossible | ((cells > 1) & (numbers < 0))
    if not codes.any():
        return values, {}
    counts = {f'{number:g}': int(n) for number, n in zip(numbers[codes], cells[codes], strict=True)}
    return np.where(np.isin(values, numbers[codes]), np.nan, values), counts


def in_words(counts: Mapping[str, int], size: int) -> str:
    """Return how many of `size` values became NaN and why."""
    total = sum(counts.values())
    most = sorted(counts.items(), key=lambda item: -item[1])
    shown = ', '.join(f'{why} ({count:,})' for why, count in most[:3])
    more = f', and {len(most) - 3} more numbers' if len(most) > 3 else ''
    return f'{total:,} of {size:,} values are read as not known: {shown}{more}'
