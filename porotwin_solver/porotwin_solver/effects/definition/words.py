"""Numbers and directions in words, for the phrases of effects."""

import math

from porotwin_core.basis.units import DAY_S, HOUR_S, MINUTE_S
from porotwin_core.model.effect_parameter import SINCE, Parameter, Reading, Values

READINGS = {
    'm': Reading(1e3, 'mm'),
    '1/s': Reading(3.6e5, '%/h'),
    '1/m': Reading(10.0, '% per 10 cm'),
    'm/s': Reading(3.6e6, 'mm/h'),
    'rad': Reading(180 / math.pi, '°'),
    'kg/m3': Reading(1.0, 'kg/m³'),
    'm2/s': Reading(1.0, 'm²/s'),
    '-': Reading(1.0, ''),
}
"""The unit of the report by the unit of a parameter; other units stay as they are."""

MOST_PERCENT = 2.0
"""Factors from this on are stated as a multiple instead of per cent; so are their inverses."""

_RAISED = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')

LONGEST_IN_SECONDS, LONGEST_IN_MINUTES, LONGEST_IN_HOURS = 90.0, 3 * HOUR_S, 3 * DAY_S
"""Times from these on are stated in minutes, hours and days [s]."""


def reading(parameter: Parameter) -> Reading:
    """Return the unit of `parameter` in a report."""
    return parameter.reading or READINGS.get(parameter.unit, Reading(1.0, parameter.unit))


def number(value: float, digits: int = 3) -> str:
    """Return `value` with `digits` significant digits, powers of ten as exponents."""
    text = f'{value:.{digits}g}'
    if 1e2 <= abs(float(text)) < 1e5:  # of the rounded value: 99.7 is 100 to two digits
        text = f'{float(text):.0f}'
    if 'e' not in text:
        return text.replace('-', '−')
    mantissa, exponent = text.split('e')
    raised = str(int(exponent)).translate(_RAISED)
    return f'{mantissa}·10{raised}'.replace('-', '−')


def factor(value: float, more: str, less: str, same: str) -> str:
    """Return how many per cent a quantity multiplied by `value` is `more` or `less`.

    A value far from 1 is stated as it is: `value` times `same`, such as 0.12 times as high as. So
    it is the number whose interval the report states.
    """
    if not 1 / MOST_PERCENT < value < MOST_PERCENT:
        return f'{number(value)} times {same}'
    return f'{number(100 * abs(value - 1))} % {more if value >= 1 else less}'


def direction(
    value: float, plus: str, minus: str, unit: str = 'mm', unit_factor: float = 1e3
) -> str:
    """Return the size of `value` in `unit` and `plus` or `minus` for its sign."""
    return f'{number(unit_factor * abs(value))} {unit} {plus if value >= 0 else minus}'


def time_span(seconds: float) -> str:
    """Return a time in seconds, minutes, hours or days."""
    if seconds < LONGEST_IN_SECONDS:
        return f'{number(seconds)} s'
    if seconds < LONGEST_IN_MINUTES:
        return f'{number(seconds / MINUTE_S)} min'
    if seconds < LONGEST_IN_HOURS:
        return f'{number(seconds / HOUR_S)} h'
    return f'{number(seconds / DAY_S)} days'


def begun(values: Values) -> str:
    """Return from when on an effect acts, behind its other words; empty from the start."""
    since = float(values.get(SINCE, 0.0))
    return f', from {time_span(since)} on' if since > 0.0 else ''


def place(values: Values) -> str:
    """Return the place `x`, `z` [m] of an effect."""
    return f'x = {values["x"]:.3f} m, z = {values["z"]:.3f} m'
