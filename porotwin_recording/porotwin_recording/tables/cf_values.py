"""Values as the attributes of a file mean them: packed numbers, and numbers for no value.

The one reader of the conventions CF and NetCDF for maps, whoever opens the file and whichever
library does. It counts the values that become NaN.

Conventions: https://cfconventions.org (2.5.1, 8.1), and the NetCDF users' guide, appendix A.
"""

from collections.abc import Mapping
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

LEAST_CONCENTRATION, LARGEST_CONCENTRATION = -1.0, 1e6
"""Concentrations [-] beyond these are no measured values in any unit, but codes for none, such as
-1, -9999 or 1e20. Noise goes down to -0.3."""

LEAST_NOISE = 0.3
"""Concentration below 0 [-] that noise does not reach."""

_VALID = ('valid_min', 'valid_max', 'valid_range')
"""Attributes with the range of the values that count."""

Counts = dict[str, int]
"""Numbers of values that became NaN, by the reason."""


def unpacked(raw: NDArray[Any], attributes: Mapping[str, Any]) -> tuple[NDArray[Any], Counts]:
    """Return the values that a file means, NaN where it has none, and how many became NaN and why.

    Args:
        raw: the numbers as they are stored.
        attributes: fill value, valid range, scale and offset of the variable.
    """
    if raw.dtype.kind not in 'biuf':
        return raw, {}
    if str(attributes.get('_Unsigned', '')).lower() == 'true' and raw.dtype.kind == 'i':
        raw = raw.view(raw.dtype.str.replace('i', 'u'))
    counts: Counts = {}
    scale, offset = attributes.get('scale_factor'), attributes.get('add_offset')
    is_packed = scale is not None or offset is not None
    missing = np.zeros(raw.shape, dtype=bool)
    for name in ('_FillValue', 'missing_value'):
        for number in np.atleast_1d(attributes.get(name, [])).tolist():
            _add(missing, _equal(raw, number), f'{number:g} ({name})', counts)
    values = raw.astype(np.float64) if is_packed or raw.dtype.kind != 'f' else raw
    values = values * (1.0 if scale is None else float(scale)) if scale is not None else values
    values = values + float(offset) if offset is not None else values
    for low, high, is_of_values, words in _ranges(attributes, raw):
        judged = values if is_of_values else raw
        with np.errstate(invalid='ignore'):
            _add(missing, (judged < low) | (judged > high), words, counts)
    return (np.where(missing, np.nan, values) if missing.any() else values), counts


def netcdf_attributes(variable: netCDF4.Variable) -> dict[str, Any]:
    """Return the attributes of a variable, with the fill value that its type has by default."""
    found = {name: variable.getncattr(name) for name in variable.ncattrs()}
    kind = variable.dtype.str[1:] if isinstance(variable.dtype, np.dtype) else ''
    if kind[:1] in 'iuf' and kind[1:] != '1' and '_FillValue' not in found:  # bytes have none
        found['_FillValue'] = netCDF4.default_fillvals.get(kind, np.nan)
    return found


def has_range(attributes: Mapping[str, Any]) -> bool:
    """Return whether a variable says which of its values count."""
    return any(name in attributes for name in _VALID)


def _equal(raw: NDArray[Any], number: Any) -> NDArray[np.bool_]:
    """Return where a number stands; it is rounded as the values are."""
    if isinstance(number, str) or number != number:
        return np.zeros(raw.shape, dtype=bool)
    with np.errstate(over='ignore'):
        same: NDArray[np.bool_] = raw == (
            raw.dtype.type(number) if raw.dtype.kind == 'f' else number
        )
    return same


def _ranges(
    attributes: Mapping[str, Any], raw: NDArray[Any]
) -> list[tuple[float, float, bool, str]]:
    """Return each range of valid values, whether it is of unpacked values, and its words.

    A range is of packed numbers, unless it is of floats.
    """
    found = []
    for name in _VALID:
        limits = np.atleast_1d(attributes.get(name, []))
        if limits.dtype.kind not in 'iuf' or len(limits) != (2 if name == 'valid_range' else 1):
            continue
        low, high = {'valid_min': (limits[0], np.inf), 'valid_max': (-np.inf, limits[0])}.get(
            name, (limits[0], limits[-1])
        )
        is_of_values = raw.dtype.kind != 'f' and limits.dtype.kind == 'f'
        words = f'outside {name} {" to ".join(f"{limit:g}" for limit in limits)}'
        found.append((float(low), float(high), is_of_values, words))
    return found


def _add(missing: NDArray[np.bool_], found: Any, words: str, counts: Counts) -> None:
    """Add the values of one reason to the missing ones, and count the new ones."""
    new = int((found & ~missing).sum())
    if new:
        counts[words] = counts.get(words, 0) + new
        missing |= found


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
