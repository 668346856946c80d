"""Numbers with a unit in a text: rates, lengths, and keys such as `width_cm` for `width_m`."""

import math
import re
from collections.abc import Container

from porotwin_core.basis.units import DARCY

_UNITS: tuple[tuple[str, str, str, str], ...] = (
    ('_ml_min', '_ml_h', '1 ml/min', '60 ml/h'),
    ('_ul_min', '_ml_h', '1 ul/min', '0.06 ml/h'),
    ('_ml_s', '_ml_h', '1 ml/s', '3600 ml/h'),
    ('_l_h', '_ml_h', '1 l/h', '1000 ml/h'),
    ('_cm', '_m', '1 cm', '0.01 m'),
    ('_mm', '_m', '1 mm', '0.001 m'),
    ('_darcy', '_m2', '1 darcy', f'{DARCY:.3g} m2'),
    ('_md', '_m2', '1 millidarcy', f'{1e-3 * DARCY:.3g} m2'),
    ('_m_d', '_m_s', '1 m/day', f'{1 / 86400:.3g} m/s'),
    ('_cm_s', '_m_s', '1 cm/s', '0.01 m/s'),
    ('_mpa_s', '_pa_s', '1 mPa s', '0.001 Pa s'),
    ('_cp', '_pa_s', '1 cP', '0.001 Pa s'),
    ('_g_cm3', '_kg_m3', '1 g/cm3', '1000 kg/m3'),
    ('_g_l', '_kg_m3', '1 g/l', '1 kg/m3'),
    ('_min', '_s', '1 min', '60 s'),
    ('_h', '_s', '1 h', '3600 s'),
    ('_s', '_min', '60 s', '1 min'),
    ('_h', '_min', '1 h', '60 min'),
)
"""Endings of keys with other units, the known endings, and the worth of one of the unit."""

_RATE = re.compile(
    r'\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*(?-i:(?!Ml))([uµμmc]?l)/(s|min|h|d)\s*', re.IGNORECASE
)
"""A rate with its unit; Ml is a megalitre."""

RATE_WORDS = 'write ml/h, as a number alone or with a unit, such as 6 l/d or 2 ml/min'
LENGTH_WORDS = 'write m, as a number alone or with a unit, such as 48 cm or 480 mm'
"""Remedies for a text that is no rate or no length."""

_LENGTH = re.compile(r'\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*([mcd]?m)\s*')

PERCENT = 100.0
"""Largest share that was probably written in percent."""


def plain_number(text: str) -> float:
    """Return the number in `text`; NaN for others, also for 5_00 and digits of other scripts."""
    try:
        return float(text) if text.isascii() and '_' not in text else math.nan
    except ValueError:
        return math.nan


def was_percent(value: float) -> str:
    """Return "; was this in percent? ..." for a share [-] above 1; empty where it cannot be."""
    percent = f'{value:g} percent = {value / PERCENT:g}'
    return f'; was this in percent? {percent}' if 1.0 < value <= PERCENT else ''


def rate_in_ml_h(text: str) -> float | None:
    """Return the rate [ml/h] in a `text` with a unit, such as 2 l/d; None for any other text."""
    found = _RATE.fullmatch(text)
    if found is None:
        return None
    unit = f'{found[2].lower()}/{found[3].lower()}'.replace('μ', 'u').replace('µ', 'u')
    return _converted(found[1], unit, 'ml/h')


def told_rate_ml_h(text: str) -> float:
    """Return the rate [ml/h] in `text`, with a unit or a number alone; NaN for other texts."""
    with_unit = rate_in_ml_h(text)
    return plain_number(text) if with_unit is None else with_unit


def length_in_m(text: str) -> float | None:
    """Return the length [m] in a `text` with a unit, such as 48 cm; None for any other text."""
    found = _LENGTH.fullmatch(text)
    return None if found is None else _converted(found[1], found[2], 'm')


def _converted(number: str, unit: str, wanted: str) -> float:
    import pint  # half a second

    return float(pint.UnitRegistry().Quantity(float(number), unit).to(wanted).magnitude)


def in_other_unit(key: str, known: Container[str]) -> str:
    """Return "write 'width_m'; 1 cm is 0.01 m" for the key `width_cm`; empty for other keys."""
    lower = key.lower()
    for ending, right, one, is_worth in _UNITS:
        meant = lower.removesuffix(ending) + right
        if lower.endswith(ending) and meant in known:
            return f"write '{meant}'; {one} is {is_worth}"
    return ''
