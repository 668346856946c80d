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

from porotwin_recording.tables.no_value import Counts

_VALID = ('valid_min', 'valid_max', 'valid_range')
"""Attributes with the range of the values that count."""


def unpacked(raw: NDArray[Any], attributes: Mapping[str, Any]) -> tuple[NDArray[Any], Counts]:
    """Return the values that a file means, NaN where it has none, and how many became NaN and why.

    Args:
        raw: the numbers as they are stored.
        attributes: fill value, valid range, scale and offset of the variable.
    """
    if raw.dtype.kind not in 'biuf':
        return raw, {}
    is_unsigned = str(attributes.get('_Unsigned', '')).lower() == 'true'
    if is_unsigned and raw.dtype.kind == 'i':
        raw = raw.view(raw.dtype.str.replace('i', 'u'))
    counts: Counts = {}
    scale, offset = attributes.get('scale_factor'), attributes.get('add_offset')
    is_packed = scale is not None or offset is not None
    missing = np.zeros(raw.shape, dtype=bool)
    for name in ('_FillValue', 'missing_value'):
        for number in _numbers(attributes.get(name, [])):
            meant = number + np.iinfo(raw.dtype).max + 1 if is_unsigned and number < 0 else number
            _add(missing, _equal(raw, meant), f'{meant:g} ({name})', counts)
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


def _numbers(attribute: Any) -> list[Any]:
    """Return the numbers of an attribute; some programs write them as text."""
    if not isinstance(attribute, str):
        return list(np.atleast_1d(attribute).tolist())
    try:
        return [float(word) for word in attribute.replace(',', ' ').split()]
    except ValueError:
        return []


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
