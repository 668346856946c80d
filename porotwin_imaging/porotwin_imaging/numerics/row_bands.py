"""Cell-wise work on a large map, band by band of rows, so that intermediate arrays stay small.

A numpy expression on a map of 4 million cells makes intermediate arrays of tens of megabytes. They
leave the cache, and each one costs memory of the operating system. A band of rows fits into the
cache. The result is the same to the last bit.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

CELLS_PER_BAND = 32_768
"""Cells of a band: a float32 array of three channels has 400 kB, a fifth of the cache of a core."""
_BAND_PER_REACH = 8
"""Rows of a band per row of its overlap: a quarter of the work is done twice at most."""


def row_bands(shape: tuple[int, ...], least: int = 1) -> Iterator[slice]:
    """Return the bands of a map of `shape` (nz, nx, ...) with at least `least` rows, in order."""
    height = max(least, CELLS_PER_BAND // shape[1])
    return (slice(start, start + height) for start in range(0, shape[0], height))


def by_bands(work: Callable[..., tuple[Array, ...]], *fields: Array) -> tuple[Array, ...]:
    """Return `work(*fields)`, computed band by band.

    Args:
        work: returns arrays whose first axis is that of the fields; each row depends only on the
            same row of the fields.
        fields: arrays with the same number of rows, shape (nz, nx, ...).
    """
    rows = len(fields[0])
    bands = list(row_bands(fields[0].shape))
    if len(bands) == 1:
        return work(*fields)
    whole: list[Array] = []
    for band in bands:
        parts = work(*(field[band] for field in fields))
        if not whole:
            whole = [np.empty((rows, *part.shape[1:]), part.dtype) for part in parts]
        for field, part in zip(whole, parts, strict=True):
            field[band] = part
    return tuple(whole)


def by_overlapping_bands(
    work: Callable[..., tuple[Array, ...]], reach: int, *fields: Array
) -> tuple[Array, ...]:
    """Return `work(*fields)`, computed band by band; each row may depend on rows near it.

    Args:
        work: returns arrays with as many rows as the fields.
        reach: a row depends on so many rows to either side.
        fields: arrays with the same number of rows, shape (nz, nx, ...).
    """
    rows = len(fields[0])
    bands = list(row_bands(fields[0].shape, least=_BAND_PER_REACH * reach))
    if len(bands) == 1:
        return work(*fields)
    whole: list[Array] = []
    for band in bands:
        first, last = max(0, band.start - reach), min(rows, band.stop + reach)
        own = slice(band.start - first, min(band.stop, rows) - first)
        parts = work(*(field[first:last] for field in fields))
        if not whole:
            whole = [np.empty((rows, *part.shape[1:]), part.dtype) for part in parts]
        for field, part in zip(whole, parts, strict=True):
            field[band] = part[own]
    return tuple(whole)
