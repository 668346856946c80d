"""Numbers in place of dates, as spreadsheets and programs count them."""

from datetime import UTC, datetime, timedelta
from typing import Literal

from porotwin_core.basis.units import DAY_S

DateNumbers = Literal[
    'excel-1900', 'excel-1904', 'matlab', 'unix-s', 'unix-ms', 'unix-us', 'unix-ns', 'labview'
]

FIRST_YEAR, LAST_YEAR = 1900, 2200
"""Years of experiments; other ones are slips."""

DATE_NUMBERS: dict[DateNumbers, tuple[float, float]] = {
    'excel-1900': (25569.0, DAY_S),
    'excel-1904': (24107.0, DAY_S),
    'matlab': (719529.0, DAY_S),
    'unix-s': (0.0, 1.0),
    'unix-ms': (0.0, 1e-3),
    'unix-us': (0.0, 1e-6),
    'unix-ns': (0.0, 1e-9),
    'labview': (24107.0 * DAY_S, 1.0),
}
"""Numbers that programs count dates with: the number of 1970-01-01, and the unit [s]."""

UNIX = ('unix-s', 'unix-ms', 'unix-us', 'unix-ns', 'labview')
"""Those that count in UTC."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def counted_from(numbers: DateNumbers, count: float) -> datetime | None:
    """Return the time that a number counts; None if it is none.

    Days are rounded to seconds, because their digits in tables end near there.
    """
    first, unit = DATE_NUMBERS[numbers]
    seconds = (count - first) * unit
    try:
        time = _EPOCH + timedelta(seconds=round(seconds) if unit == DAY_S else seconds)
    except (OverflowError, ValueError):
        return None
    return time if _EPOCH.year < time.year <= LAST_YEAR else None
