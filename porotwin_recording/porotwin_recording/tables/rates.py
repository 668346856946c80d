"""Pump rates over time: `rates.csv` and `rates_measured.csv` of an experiment folder."""

from collections.abc import Iterable
from pathlib import Path

from porotwin_core.basis.csv_table import number_text, parse_number, read_table, write_table
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import as_known
from porotwin_core.basis.text_with_unit import rate_in_ml_h, was_percent
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, from_ml_h, to_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate

ROUND_OFF = 1e-15
"""Relative round-off of a sum of rates and of a change of units [-]: some last binary digits."""

HEADER = ('time_s', 'well', 'rate_ml_h', 'concentration')


def read_rates(path: Path, wells: Iterable[str]) -> Schedule:
    """Return the schedule in the file `path`, converted to SI units.

    Args:
        path: table with the columns of `HEADER`.
        wells: names of the rig's wells; the table may use no others.

    Raises:
        InputError: one line that names file, line, value and remedy.
    """
    known = tuple(wells)
    rows: list[ScheduleRow] = []
    for where, words in read_table(path, HEADER, 'the pump rates'):
        row = _row(words, where, known)
        if rows and row.time < rows[-1].time:
            raise InputError(
                f'{where}: time_s {row.time:g} comes after {rows[-1].time:g}; sort the rows by time'
            )
        rows.append(row)
    if known and not rows:
        raise InputError(f'{path}: has no rows, so that no well ever pumps; add rows or remove it')
    return Schedule(tuple(rows))


def measured_to(measured: Schedule, end: float) -> Schedule:
    """Return measured rates [m^3/s] with a row of every well at `end` [s], not before them.

    From the last row of all wells on, the commands of wells without a row there count.
    """
    there = {row.well for row in measured.rows if row.time == end}
    held = [
        ScheduleRow(end, well, rate) for well, rate in measured.at(end).items() if well not in there
    ]
    return Schedule((*measured.rows, *held))


def _row(words: list[str], where: str, wells: tuple[str, ...]) -> ScheduleRow:
    time = parse_number(words[0], f'{where}: time_s')
    if time < 0:
        raise InputError(f'{where}: time_s {time:g} is negative; times count from the start')
    if time > LONGEST_EXPERIMENT_S:
        raise InputError(f'{where}: time_s {time:g} is more than a year; write seconds')
    well = as_known(words[1], wells)
    if well not in wells:
        raise InputError(f"{where}: unknown well '{well}'; the rig has {', '.join(wells)}")
    rate_ml_h = rate_in_ml_h(words[2])
    if rate_ml_h is None:
        rate_ml_h = parse_number(words[2], f'{where}: rate_ml_h')
    if rate_ml_h > 0 and not words[3]:
        raise InputError(
            f"{where}: well '{well}' injects {rate_ml_h:g} ml/h, but nothing tells of what; write "
            f'{-rate_ml_h:g} if it takes water out, or the concentration: 0 for water, 1 for stock'
        )
    concentration = parse_number(words[3], f'{where}: concentration') if words[3] else 0.0
    if not 0.0 <= concentration <= 1.0:
        raise InputError(
            f'{where}: concentration {concentration:g}; must lie between 0 (water) and 1 (stock)'
            f'{was_percent(concentration)}'
        )
    return ScheduleRow(
        time, well, WellRate(from_ml_h(rate_ml_h), 0.0 if rate_ml_h < 0 else concentration)
    )


def write_rates(path: Path, schedule: Schedule) -> None:
    """Write `schedule` as a table that `read_rates` reads back.

    Rates are written in ml/h, without the round-off of sums and changes of units.
    """
    write_table(
        path,
        HEADER,
        (
            (
                number_text(row.time),
                row.well,
                _rate_ml_h(row.rate.rate),
                '' if row.rate.rate < 0 else number_text(row.rate.concentration),
            )
            for row in schedule.rows
        ),
    )


def _rate_ml_h(rate: float) -> str:
    """Return the shortest decimal number in ml/h that is `rate` [m^3/s] but for `ROUND_OFF`."""
    exact = to_ml_h(rate)
    shorter = (float(f'{exact:.{digits}g}') for digits in range(1, 17))
    near = (one for one in shorter if abs(one - exact) <= ROUND_OFF * abs(exact))
    return number_text(next(near, exact))
