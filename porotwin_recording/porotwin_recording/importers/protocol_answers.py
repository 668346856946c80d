"""A person answers the open questions of protocols; times follow these answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.date_numbers import DateNumbers
from porotwin_recording.importers.foreign_table import Decimal, ForeignTable
from porotwin_recording.importers.foreign_time import TIME_ALONE, DateOrder, moments
from porotwin_recording.importers.twelve_hours import Clock

IMAGING_PROTOCOL = 'imaging_protocol.csv'
INJECTION_PROTOCOL = 'injection_protocol.csv'
MEASURED_PROTOCOL = 'measured_protocol.csv'
LEVEL_PROTOCOL = 'level_protocol.csv'


@dataclass(frozen=True)
class ProtocolAnswers:
    """Answers to open questions of protocols; empty or None: as the protocols show.

    Attributes:
        date_order: order of day and month.
        time_zone: zone of times without one, such as Europe/Oslo.
        decimal: decimal point or comma.
        rate_unit: unit of rates, such as ml/min.
        concentration: concentration of injected fluids where no column has it [-]: one for all
            wells, or one for each by name.
        camera_ahead_s: time by which the camera's clock is ahead of the pumps' [s].
        time_zero: date and time of second 0 of rates.csv, by the clock of the pumps.
        date_numbers: system of numbers in place of dates.
        clock: a 12-hour clock of the pumps.
    """

    date_order: DateOrder | None = None
    time_zone: str = ''
    decimal: Decimal | None = None
    rate_unit: str = ''
    concentration: float | Mapping[str, float] | None = None
    camera_ahead_s: float = 0.0
    time_zero: str = ''
    date_numbers: DateNumbers | None = None
    clock: Clock | None = None


def concentration_in(text: str) -> float | dict[str, float] | None:
    """Return the concentration in a text such as '1', or those of wells, as in 'dye=1,water=0'.

    None if the text is empty.

    Raises:
        InputError: it holds something else than shares of tracer stock from 0 to 1.
    """
    if not text.strip():
        return None
    if '=' not in text:
        return _share(text, text)
    pairs = (part.partition('=') for part in text.split(','))
    return {well.strip(): _share(share, text) for well, _, share in pairs}


def _share(text: str, whole: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0.0 <= share <= 1.0:
        raise InputError(
            f"--concentration '{whole}': give a share of the tracer stock from 0 (water) to 1 for "
            'all wells, or one for each: dye=1,water=0'
        )
    return share


def dated_words(table: ForeignTable, title: str) -> list[str]:
    """Return the words of a column of times, with the dates of another column if they have none."""
    words = table.columns[title]
    date = table.find('date')
    if date in (None, title) or not all(map(TIME_ALONE.fullmatch, words)):
        return words
    days = table.columns[str(date)]
    return [f'{day} {word}' for day, word in zip(days, words, strict=True)]


def protocol_moments(
    table: ForeignTable, title: str, answers: ProtocolAnswers, told: list[str]
) -> list[datetime]:
    """Return the times in the column `title`; tell the assumptions about them."""
    where = f'{table.path}: {table.spelt(title)}'
    found, remarks = moments(
        dated_words(table, title),
        where,
        numbers=answers.date_numbers,
        order=answers.date_order,
        zone=answers.time_zone,
        places=[f'{where}:{line}' for line in table.lines],
    )
    told += [line for line in remarks if line not in told]
    return found
