"""Units of rates, times and lengths as other programs write them: ml/h, mL h-1, ml·h⁻¹, ml pro Std.

The library pint knows the units, and cftime the times of CF. Words and signs of other languages are
made plain first.
"""

import re
import unicodedata
from functools import cache
from typing import TYPE_CHECKING

import cftime

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.words_of_languages import NAMES, UNITS, plain, with_plain_signs

if TYPE_CHECKING:
    import pint

DENSITY_RANGE = (500.0, 3000.0)
"""Densities of liquids [kg/m^3]."""

SHARES = {'': 1.0, '1': 1.0, '-': 1.0, '%': 1e-2}
"""Shares of the tracer stock [-] by name."""

_PLAIN_UNIT = re.compile(r'[a-z\d*/%.()-]{1,40}')
"""Texts for the library; it computes powers, so others are kept from it."""

_CALENDAR_UNIT = re.compile(r'(month|year)s?|mon|yr|a')

_NAMED = re.compile(
    '(?:'
    + '|'.join(sorted({name for names in NAMES.values() for name in names}, key=len)[::-1])
    + ')_'
)
"""A name of a quantity in front of its unit, as in flow_rate_ml_min."""


def unit_in(title: str) -> str:
    """Return the unit in a title: `rate [ml/min]`, `rate / ml/min`, `rate_ml/min`, `rate_ml_min`.

    Empty: there is none.
    """
    bracket = re.search(r'[\[(]([^\])]*)[\])]', title)
    if bracket:
        return with_plain_signs(bracket[1]).strip().lower()
    name, slash, behind = with_plain_signs(title).partition(' / ')
    if slash and not is_unit(name):
        return behind.strip().lower()
    word = plain(title).replace(',', '')
    named = _NAMED.match(word)
    _, _, rest = ('', '', word[named.end() :]) if named else word.partition('_')
    rest = re.sub('^(in|en|i)_', '', rest).replace('_per_', '/')
    return rest.replace('_', '/') if '/' not in rest else rest.replace('_', '')


def plain_unit(unit: str) -> str:
    """Return a unit in the signs of a keyboard and in English: ml·h⁻¹ and ml pro Std are ml/h."""
    text = with_plain_signs(unit).lower().replace('µ', 'u').replace('μ', 'u')
    text = with_plain_signs(unicodedata.normalize('NFKC', text))  # powers above the line
    text = re.sub(r'\s*[·⋅•×∙*]\s*|(?<=[a-z\d])\.(?=[a-z])', ' ', text)
    words = (UNITS.get(plain(word), word) for word in re.findall(r'[^\W\d_]+|[^\w\s]|\d+|\s', text))
    text = re.sub(r'\s*/\s*', '/', ''.join(words).replace('**', '^')).strip(' .')
    text = re.sub(r'(?<=[a-z])\^?\(?(-?\d+)\)?', r'**\1', text)
    text = re.sub(r'\s+', '*', text)
    return re.sub(r'^([a-z]+(?:\*\*3)?)\*([a-z]+)\*\*-1$', r'\1/\2', text)


@cache
def _registry() -> 'pint.UnitRegistry':
    import pint  # half a second

    return pint.UnitRegistry()


def _size_in(unit: str, wanted: str) -> float | None:
    """Return the size of one `unit` in the `wanted` one; None if it is none of its kind."""
    text = plain_unit(unit)
    if not _PLAIN_UNIT.fullmatch(text) or re.search(r'\d\d', text):
        return None
    try:
        return float(_registry().Quantity(1.0, _registry().parse_units(text)).to(wanted).magnitude)
    except Exception:  # it raises errors of many types
        return None


def is_unit(text: str) -> bool:
    """Return whether a word is a unit of a rate, time, length, density or share."""
    word = plain(text)
    return UNITS.get(word, word) in SHARES or any(
        _size_in(text, wanted) is not None for wanted in ('m^3/s', 'kg/s', 's', 'm', 'kg/m^3')
    )


def rate_factor(unit: str, where: str, *, density_kg_m3: float) -> float:
    """Return the rate [m^3/s] of one `unit`, such as ml/min.

    Args:
        unit: volume or mass per time.
        where: file and column, for messages.
        density_kg_m3: density of the fluid, for masses.

    Raises:
        InputError: it is no unit of a rate.
    """
    size = _size_in(unit, 'm^3/s')
    mass = _size_in(unit, 'kg/s') if size is None else None
    if size is None and mass is None:
        said = f"'{unit}' is no unit of a rate" if unit else 'has no unit'
        raise InputError(
            f'{where}: {said}; give its unit with --rate-unit, a volume or mass per time'
        )
    return size if mass is None else mass / density_kg_m3  # type: ignore[return-value]


def time_factor(unit: str, where: str) -> float:
    """Return the time [s] of one `unit`, as the conventions of CF name it.

    Raises:
        InputError: it is no unit of time, or one of different lengths, such as a month.
    """
    try:
        epoch, after = cftime.num2date([0.0, 1.0], f'{plain_unit(unit)} since 2000-01-01')
    except (ValueError, TypeError, OverflowError):
        # of years and months the calendar tells the length; those with another name have one
        size = None if _CALENDAR_UNIT.fullmatch(plain_unit(unit)) else _size_in(unit, 's')
        if size is not None:
            return size
        said = f"'{unit}' is no unit of time with one length" if unit else 'has no unit'
        raise InputError(f'{where}: {said}') from None
    return float((after - epoch).total_seconds())


def length_factor(unit: str, where: str) -> float:
    """Return the length [m] of one `unit`; without a unit metres.

    Raises:
        InputError: it is no unit of a length.
    """
    size = _size_in(unit or 'm', 'm')
    if size is None:
        raise InputError(f"{where} is in '{unit}'; write m, cm or mm")
    return size


def density_factor(unit: str, where: str) -> float:
    """Return the density [kg/m^3] of one `unit`; without a unit kg/m3.

    Raises:
        InputError: it is no unit of a density.
    """
    size = _size_in(unit or 'kg/m3', 'kg/m^3')
    if size is None:
        raise InputError(f"{where}: '{unit}' is no unit of a density; write kg/m3 or g/cm3")
    return size


def check_density(density: float, where: str) -> float:
    """Return `density` [kg/m^3].

    Raises:
        InputError: no liquid has it.
    """
    low, high = DENSITY_RANGE
    if not low <= density <= high:
        raise InputError(
            f'{where}: {density:g} kg/m3 is no density of a liquid; write its unit into the title, '
            'such as density [g/cm3]'
        )
    return density


def share_factor(unit: str, where: str) -> float:
    """Return the share of the tracer stock [-] of one `unit`.

    Raises:
        InputError: it is no unit of a share.
    """
    word = plain(unit).strip('[]()')
    share = SHARES.get(UNITS.get(word, word))
    if share is None:
        raise InputError(
            f"{where}: '{unit}' is no share of the tracer stock; write shares from 0 to 1, or %"
        )
    return share
