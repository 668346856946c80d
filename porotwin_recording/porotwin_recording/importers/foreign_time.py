"""Dates and times of other programs: order of day and month, am and pm, time zones."""

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Literal
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_recording.importers.date_numbers import (
    DATE_NUMBERS,
    FIRST_YEAR,
    LAST_YEAR,
    UNIX,
    DateNumbers,
    counted_from,
)
from porotwin_recording.importers.foreign_table import number_in
from porotwin_recording.importers.open_question import QuestionError
from porotwin_recording.importers.words_of_languages import ZONES, month_of, with_plain_signs

DateOrder = Literal['day-first', 'month-first']
HALF_DAY_H = 12
CENTURY = 2000
"""Years of two digits belong to this century."""

_TIME = (
    r'(?:[T_\s,]+(?P<time>\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?)'
    r'\s*(?P<half>[AaPp]\.?\s?[Mm]\.?)?)?'
)
_ZONE = rf'\s*(?P<zone>[+-]\d{{2}}:?\d{{2}}|{"|".join(ZONES)})?'
_BASIC = re.compile(r'\d{8}T\d{4,6}(?:[.,]\d+)?(?:Z|[+-]\d{2}:?\d{2})?|\d{4}-?W\d{2}-?\d.*')
"""Dates of ISO 8601 without marks between their parts, or by their week."""
_ISO = re.compile(
    rf'(?P<year>\d{{4}})[-/.](?P<month>\d{{1,2}})[-/.](?P<day>\d{{1,2}}){_TIME}{_ZONE}'
)
_OTHER = re.compile(
    rf'(?P<one>\d{{1,2}})(?P<mark>[-/.])(?P<two>\d{{1,2}})[-/.](?P<year>\d{{4}}|\d{{2}}){_TIME}{_ZONE}'
)
_NAMED_DAY = re.compile(
    r'(\d{1,2})\.?[-\s/]+(?:de\s+)?([^\W\d_]{3,})\.?[-\s/,]+(?:de\s+)?(\d{4}|\d{2}(?=\s|$))'
)
_OF_C = re.compile(r'([^\W\d_]{3,}\s+\d{1,2})\s+(\d{1,2}:\d{2}:\d{2})\s+(\d{4})')
"""Dates as the function asctime of C writes them, such as Fri May 31 14:30:00 2024."""
_EASTERN = str.maketrans(dict(zip('年月日時分秒时년월일시분초', '-- ::  -- :: ', strict=True)))
"""Signs of China, Japan and Korea between the parts of a date, and what stands for each here."""
_EASTERN_HALF = re.compile(r'(上午|午前|오전)|(?:下午|午後|오후)')
"""Words of the East for the half of the day, which stand before the time."""
_NAMED_MONTH = re.compile(r'([^\W\d_]{3,})\.?\s+(\d{1,2})(?:st|nd|rd|th)?,?\s+(\d{4})')
_AROUND = re.compile(
    r'^(?:le\s+)?[^\W\d_]{2,}[.,]*\s+(?=\d)|\b(?:uhr|kl\.?|klo|kello|um|h)(?=\s|$)|\sà(?=\s)',
    re.IGNORECASE,
)
"""Names of days before a date, and words around a time of day."""
_OTHER_CLOCK = re.compile(
    r'(?<=\s)(\d{1,2})(?:[.hH]|\s?h\s?)(\d{2})(?:[.m](\d{2}))?\s?s?(?=\s*[AaPp+-]|\s*$)'
)
"""Times such as 14.30 and 14h30."""
TIME_ALONE = re.compile(
    r'\d{1,2}[:.hH]\d{2}(?:[:.m]\d{2})?(?:[.,]\d+)?\s*(?:[AaPp]\.?\s?[Mm]\.?|Uhr|h|s)?'
)
"""A time of day whose date stands in another column."""


def _ordinary(text: str) -> str:
    """Return a date in a rare form of ISO 8601, of C or of the East in the usual one."""
    if any(sign in text for sign in '年月년월'):
        if half := _EASTERN_HALF.search(text):
            text = f'{text.replace(half[0], "")} {"AM" if half[1] else "PM"}'
        text = ' '.join(text.translate(_EASTERN).split()).replace('- ', '-').replace(': ', ':')
        return re.sub(r'[:-](?=$|[AP]M$)', ' ', text).strip()
    text = re.sub(r"^'|\[[\w/]+\]$", '', text)  # of a spreadsheet; the name of a zone
    text = re.sub(r'\s*(?:UTC|GMT)([+-])(\d{1,2})(?::?00)?$', _offset, text)
    text = re.sub(r'(?<=\d[T_ ]\d\d)-(\d\d)-(\d\d)$', r':\1:\2', text)
    text = _OF_C.sub(r'\1 \3 \2', text)
    for form in ('%Y-%jT%H:%M:%S', '%Y-%j %H:%M:%S', '%Y%jT%H%M%S'):
        with suppress(ValueError):
            time = datetime.strptime(text, form)
            if text.startswith(str(time.year)):  # day 366 of another year is no date
                return time.isoformat(' ')
    if _BASIC.fullmatch(text):
        with suppress(ValueError):
            return datetime.fromisoformat(text).isoformat(' ')
    return text


def _offset(found: re.Match[str]) -> str:
    """Return UTC+2 as +02:00."""
    return f'{found[1]}{int(found[2]):02d}:00'


def plain_date(word: str) -> str:
    """Return a date with time as digits, whatever words name its month, day and hours."""
    text = _ordinary(with_plain_signs(word).strip())
    for pattern, order in ((_NAMED_DAY, (3, 2, 1)), (_NAMED_MONTH, (3, 1, 2))):
        found = pattern.search(text)
        month = month_of(found[order[1]]) if found else None
        if found and month:
            year = int(found[order[0]])
            year += CENTURY * (len(found[order[0]]) == len('24'))
            date = f'{year}-{month:02d}-{int(found[order[2]]):02d}'
            text = f'{date}{text[found.end() :]}'
            break
    text = ' '.join(_AROUND.sub(' ', text).split())
    head, space, rest = text.partition(' ')
    if ':' not in rest:
        rest = _OTHER_CLOCK.sub(r' \1:\2:\3', f' {rest}').strip().replace(': ', ' ').rstrip(':')
    return f'{head}{space}{rest}'


def _matched(word: str) -> re.Match[str] | None:
    text = plain_date(word)
    return _ISO.fullmatch(text) or _OTHER.fullmatch(text)


def moments(
    words: Sequence[str],
    where: str,
    *,
    order: DateOrder | None = None,
    zone: str = '',
    places: Sequence[str] = (),
    numbers: DateNumbers | None = None,
) -> tuple[list[datetime], list[str]]:
    """Return the times in `words`, and the assumptions that were made, one line each.

    Times without a zone are those of one clock that nobody set in between; with `zone` they follow
    its summer time, and a time that does not exist there or occurs twice is refused. They are
    returned as if they were UTC, so that differences are right.

    Args:
        words: dates with times, all written alike.
        where: file and column, for messages.
        order: order of day and month in dates such as 3/4/2024; None: as the dates show.
        zone: time zone, such as Europe/Oslo; empty: none.
        places: the place of each word, for messages; empty: its row in a table with a header.
        numbers: system of numbers in place of dates; None: not known.

    Raises:
        InputError: a word is no time, lacks the time of day that others have, is none in its zone,
            is more than a year from most others, or can be read in two ways.
    """
    places = places or [f'{where}:{row}' for row in range(2, len(words) + 2)]
    if words and all(math.isfinite(_number(word)) for word in words):
        return _counted(words, places, zone, numbers)
    matches = [_matched(word) for word in words]
    for word, match, place in zip(words, matches, places, strict=True):
        if match is None:
            raise InputError(
                f"{place}: '{word}' is no date; write 2024-05-31 14:30:00, or with its zone "
                '2024-05-31 14:30:00+02:00'
            )
    found = [match for match in matches if match is not None]
    _check_clock_times(found, places)
    told: list[str] = []
    doubtful = [match for match in found if 'one' in match.groupdict()]
    day_first = _is_day_first(
        [(m['one'], m['two'], m['mark']) for m in doubtful], where, order, told
    )
    _check_two_digits(doubtful, where)
    zoned = [match['zone'] is not None for match in found]
    if any(zoned) and not all(zoned):
        raise InputError(f'{where}: some times have a zone and some have none; write them alike')
    if found and not any(zoned):
        told.append(
            f'times without a zone: taken as times of {zone}'
            if zone
            else 'times without a zone: taken as times of one clock; --time-zone names its zone'
        )
    times = [
        _moment(match, day_first, zone, place) for match, place in zip(found, places, strict=True)
    ]
    _check_years(times, words, places)
    return times, told


def _number(word: str) -> float:
    return number_in(word, 'comma' if ',' in word else 'point')


def _counted(
    words: Sequence[str], places: Sequence[str], zone: str, numbers: DateNumbers | None
) -> tuple[list[datetime], list[str]]:
    """Return the times that numbers count; local ones if a spreadsheet or MATLAB wrote them.

    Raises:
        QuestionError: their system is not known.
        InputError: they count no dates of an experiment.
    """
    if numbers is None:
        latest, now = max(map(_number, words)), datetime.now(UTC)
        readings = {
            name: counted_from(name, _number(words[0]))
            for name in DATE_NUMBERS
            if (last := counted_from(name, latest)) and last.date() <= now.date()
        }
        shown = [f'{name}: {time:%Y-%m-%d %H:%M:%S}' for name, time in readings.items() if time]
        raise QuestionError(
            f"{places[0]}: '{words[0]}' counts from a date ({', '.join(shown) or 'none is known'})",
            [{'date_numbers': name} for name, time in readings.items() if time],
            'write dates, such as 2024-05-31 14:30:00',
        )
    found = []
    for word, place in zip(words, places, strict=True):
        time = counted_from(numbers, _number(word))
        if time is None:
            raise InputError(f"{place}: '{word}' is no date in {numbers}; correct it")
        local = zone and numbers not in UNIX
        found.append(_in_zone(time.replace(tzinfo=None), zone, place) if local else time)
    _check_years(found, words, places)
    return found, [f'numbers are dates of {numbers}']


def names_zone(words: Sequence[str], numbers: DateNumbers | None = None) -> bool:
    """Return whether the times in `words` tell their zone: by Z or +02:00, or as counts in UTC."""
    if numbers in UNIX and words and all(math.isfinite(_number(word)) for word in words):
        return True
    matches = map(_matched, words)
    return any(match is not None and match['zone'] is not None for match in matches)


def _check_years(times: Sequence[datetime], words: Sequence[str], places: Sequence[str]) -> None:
    """Refuse a time that is more than a year from most others: a clock was not set."""
    if not times:
        return
    middle = sorted(range(len(times)), key=lambda at: times[at])[len(times) // 2]
    for at, time in enumerate(times):
        if abs((time - times[middle]).total_seconds()) > LONGEST_EXPERIMENT_S:
            raise InputError(
                f"{places[at]}: '{words[at]}' is more than a year from '{words[middle]}' of "
                f'{places[middle]}; correct the one that is wrong'
            )


def _check_clock_times(found: Sequence[re.Match[str]], places: Sequence[str]) -> None:
    """Refuse a date without a time of day beside dates with one: it is no midnight for sure."""
    missing = [at for at, match in enumerate(found) if match['time'] is None]
    if missing and len(missing) < len(found):
        date = found[missing[0]][0]
        raise InputError(
            f"{places[missing[0]]}: '{date}' has no time of day, and other rows have one; write it "
            f"as in '{date} 14:30:00', or '{date} 00:00:00' if it was midnight"
        )


def _check_two_digits(found: Sequence[re.Match[str]], where: str) -> None:
    """Refuse 24-05-30, where nothing shows whether year or day comes first."""
    for match in found:
        if match['mark'] == '-' and len(match['year']) == len('24'):
            date = '-'.join(match[name] for name in ('one', 'two', 'year'))
            raise InputError(
                f"{where}: is '{date}' in {CENTURY + int(match['one'])} or in "
                f'{CENTURY + int(match["year"])}? write years with four digits, as in 2024-05-31'
            )


def _is_day_first(
    dates: Sequence[tuple[str, str, str]], where: str, order: DateOrder | None, told: list[str]
) -> bool:
    """Return whether the day comes first; add the reason to `told`."""
    first = any(int(one) > datetime.max.month for one, _, _ in dates)
    second = any(int(two) > datetime.max.month for _, two, _ in dates)
    if first and second:
        raise InputError(
            f'{where}: some dates have the day first and some the month; write 2024-05-31'
        )
    if not dates or first or second:
        return first
    if order is not None:
        return order == 'day-first'
    if all(mark == '.' for _, _, mark in dates):
        told.append(f'{where}: dates with points, taken with the day first')
        return True
    one, two, mark = dates[0]
    raise QuestionError(
        f"{where}: is '{one}{mark}{two}' day and month, or month and day?",
        [{'date_order': 'day-first'}, {'date_order': 'month-first'}],
        'write dates such as 2024-05-31',
    )


def _moment(match: re.Match[str], day_first: bool, zone: str, where: str) -> datetime:
    parts = match.groupdict()
    if 'one' in parts:
        day, month = (parts['one'], parts['two'])[:: 1 if day_first else -1]
    else:
        day, month = parts['day'], parts['month']
    year = int(parts['year']) + CENTURY * (len(parts['year']) == len('24'))
    if not FIRST_YEAR <= year <= LAST_YEAR:
        raise InputError(f"{where}: '{match[0]}' is no date of an experiment; correct the year")
    try:
        hour, minute, second = _clock(parts['time'], parts['half'])
        whole = int(second)
        moment = datetime(year, int(month), int(day), hour, minute, whole)
        moment += timedelta(microseconds=round(1e6 * (second - whole)))
        if parts['zone']:
            written = ZONES.get(parts['zone'], parts['zone'])
            return datetime.fromisoformat(f'{moment.isoformat()}{written}').astimezone(UTC)
    except ValueError as error:
        beyond = parts['time'] in ('24:00', '24:00:00', '23:59:60')  # the last: a leap second
        remedy = 'write 00:00:00 of the next day' if beyond else 'correct it'
        raise InputError(f"{where}: '{match[0]}' is no date ({error}); {remedy}") from None
    if not zone:
        return moment.replace(tzinfo=UTC)
    return _in_zone(moment, zone, where)


def _in_zone(moment: datetime, zone: str, where: str) -> datetime:
    """Return a local time as UTC.

    Raises:
        InputError: the zone is not known, or its clocks show the time never or twice.
    """
    try:
        local = moment.replace(tzinfo=ZoneInfo(zone))
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise InputError(
            f"--time-zone '{zone}' is not known; write one such as Europe/Oslo"
        ) from None
    first, second = (local.replace(fold=fold).astimezone(UTC) for fold in (0, 1))
    if first == second:
        return first
    if first > second:  # the clocks jumped over it
        raise InputError(
            f"{where}: '{moment}' does not exist in {zone}: the clocks were set forward; correct "
            'the time, or leave --time-zone out if nobody set this clock'
        )
    raise InputError(
        f"{where}: '{moment}' occurs twice in {zone}: the clocks were set back; write its zone, "
        f'such as {local.isoformat(" ")}, or leave --time-zone out if nobody set this clock'
    )


def _clock(text: str | None, half: str | None) -> tuple[int, int, float]:
    """Return hour, minute and second; midnight without a text.

    Raises:
        ValueError: the hour contradicts its am.
    """
    hour, minute, *rest = (text or '0:00').replace(',', '.').split(':')
    whole = int(hour)
    if half and whole > HALF_DAY_H and half[0] in 'Aa':
        raise ValueError(f'hour {whole} is not in the morning')
    if half and whole <= HALF_DAY_H:  # others write 14:30 PM
        whole = whole % HALF_DAY_H + HALF_DAY_H * (half[0] in 'Pp')
    return whole, int(minute), float(rest[0]) if rest else 0.0
