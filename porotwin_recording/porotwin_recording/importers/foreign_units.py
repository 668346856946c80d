"""Units of rates, times and lengths as other programs write them.

The library pint was tried. It does not know `m3` and `g/cm3`, takes `ph` for a picohour, and its
start takes 1 s; the tables below are as long as its corrections would be.
"""

import re

from porotwin_core.basis.errors import InputError

VOLUMES = {
    'm3': 1.0,
    'm^3': 1.0,
    'l': 1e-3,
    'dm3': 1e-3,
    'ml': 1e-6,
    'cm3': 1e-6,
    'cm^3': 1e-6,
    'cc': 1e-6,
    'ul': 1e-9,
    'µl': 1e-9,
    'μl': 1e-9,
    'mm3': 1e-9,
    'nl': 1e-12,
}
"""Volumes [m^3] by name, in small letters."""

MASSES = {'kg': 1.0, 'g': 1e-3, 'mg': 1e-6}
"""Masses [kg] by name."""

TIMES = {
    'ms': 1e-3,
    's': 1.0,
    'sec': 1.0,
    'second': 1.0,
    'seconds': 1.0,
    'min': 60.0,
    'minute': 60.0,
    'minutes': 60.0,
    'h': 3600.0,
    'hr': 3600.0,
    'hour': 3600.0,
    'hours': 3600.0,
    'd': 86400.0,
    'day': 86400.0,
    'days': 86400.0,
}
"""Times [s] by name."""

DENSITIES = {
    'kg/m3': 1.0,
    'kg/m^3': 1.0,
    'g/l': 1.0,
    'g/cm3': 1e3,
    'g/cm^3': 1e3,
    'g/ml': 1e3,
    'kg/l': 1e3,
}
"""Densities [kg/m^3] by name."""

DENSITY_RANGE = (500.0, 3000.0)
"""Densities of liquids [kg/m^3]."""

SHARES = {'': 1.0, '1': 1.0, '-': 1.0, '%': 1e-2, 'percent': 1e-2}
"""Shares of the tracer stock [-] by name."""

LENGTHS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3}
"""Lengths [m] by name."""


def unit_in(title: str) -> str:
    """Return the unit in a title: `rate [ml/min]`, `rate (ml/min)`, `rate_ml/min`, `rate_ml_min`.

    Empty: there is none.
    """
    bracket = re.search(r'[\[(]([^\])]*)[\])]', title)
    if bracket:
        return bracket[1].strip().lower()
    _, _, rest = title.lower().partition('_')
    return rest.replace('_per_', '/').replace('_', '/') if rest else ''


def rate_factor(unit: str, where: str, *, density_kg_m3: float) -> float:
    """Return the rate [m^3/s] of one `unit`, such as ml/min.

    Args:
        unit: volume or mass per time.
        where: file and column, for messages.
        density_kg_m3: density of the fluid, for masses.

    Raises:
        InputError: it is no unit of a rate.
    """
    text = unit.lower().replace(' ', '').replace('s-1', '/s').replace('per', '/')
    amount, _, time = text.partition('/')
    size = VOLUMES.get(amount)
    if size is None and amount in MASSES:
        size = MASSES[amount] / density_kg_m3
    if size is None or time not in TIMES:
        said = f"'{unit}' is no unit of a rate" if unit else 'has no unit'
        raise InputError(f'{where}: {said}; give --rate-unit, such as ml/min, ml/h, ul/s or m3/s')
    return size / TIMES[time]


def time_factor(unit: str, where: str) -> float:
    """Return the time [s] of one `unit`.

    Raises:
        InputError: it is no unit of time.
    """
    if unit.lower() not in TIMES:
        said = f"'{unit}' is no unit of time" if unit else 'has no unit'
        raise InputError(f'{where}: {said}; give --time-unit s, min or h')
    return TIMES[unit.lower()]


def density_factor(unit: str, where: str) -> float:
    """Return the density [kg/m^3] of one `unit`; without a unit kg/m3.

    Raises:
        InputError: it is no unit of a density.
    """
    if unit and unit.lower().replace(' ', '') not in DENSITIES:
        raise InputError(f"{where}: '{unit}' is no unit of a density; write kg/m3 or g/cm3")
    return DENSITIES.get(unit.lower().replace(' ', ''), 1.0)


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
    if unit.lower() not in SHARES:
        raise InputError(
            f"{where}: '{unit}' is no share of the tracer stock; write shares from 0 to 1, or %"
        )
    return SHARES[unit.lower()]
