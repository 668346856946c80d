"""Tests of dates and times of other programs: zones, and clocks that are set."""

from datetime import UTC, datetime

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.foreign_time import moments, names_zone
from porotwin_recording.importers.twelve_hours import on_twelve_hours


def test_times_of_a_zone_follow_its_summer_time() -> None:
    words = ['2024-03-31 01:59:00', '2024-03-31 03:01:00']
    (before, after), _ = moments(words, 'p.csv: datetime', zone='Europe/Oslo')
    assert (after - before).total_seconds() == 120.0


@pytest.mark.parametrize(
    ('word', 'fault'),
    [
        ('2024-03-31 02:30:00', r'p\.csv: datetime:3: .*02:30:00. does not exist in Europe/Oslo'),
        ('2024-10-27 02:30:00', r'p\.csv: datetime:3: .*02:30:00. occurs twice .*02:30:00\+02:00'),
    ],
)
def test_a_time_that_a_clock_never_or_twice_shows_is_refused(word: str, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        moments(['2024-03-01 12:00:00', word], 'p.csv: datetime', zone='Europe/Oslo')
    assert len(moments([word], 'p.csv: datetime')[0]) == 1  # one clock that nobody set


@pytest.mark.parametrize('zone', ['Europe', 'Europe/Olso', '../etc'])
def test_an_unknown_zone_is_refused(zone: str) -> None:
    with pytest.raises(InputError, match=r'--time-zone .* is not known'):
        moments(['2024-03-01 12:00:00'], 'p.csv: datetime', zone=zone)


def test_words_that_name_a_zone_are_seen() -> None:
    assert names_zone(['note', '2024-03-01T12:00:00Z'])
    assert not names_zone(['2024-03-01 12:00:00', 'DSC_1.JPG'])


def test_a_date_without_a_time_of_day_beside_others_is_refused() -> None:
    words = ['24.11.2026 09:59:00', '24.11.2026']
    with pytest.raises(InputError, match=r"p\.csv: when:3: '24\.11\.2026' has no time of day"):
        moments(words, 'p.csv: when')
    (first, second), _ = moments(['24.11.2026', '25.11.2026'], 'p.csv: when')
    assert (second - first).total_seconds() == 86400.0


@pytest.mark.parametrize('word', ['2024-05-31 10:00:00+25:00', '2024-05-31 10:00:00+24:60'])
def test_an_offset_of_more_than_a_day_is_refused(word: str) -> None:
    with pytest.raises(InputError, match='is no date'):
        moments([word], 'p.csv: datetime')


def test_a_fraction_that_rounds_up_to_a_second_is_a_time() -> None:
    (moment,), _ = moments(['2024-05-31 10:00:00.9999999'], 'p.csv: datetime')
    assert (moment.minute, moment.second, moment.microsecond) == (0, 1, 0)


@pytest.mark.parametrize(
    ('word', 'fault'),
    [
        ('2024-05-31 13:00 AM', r'hour 13 is not in the morning\); correct it'),
        ('2016-12-31 23:59:60', r'\); write 00:00:00 of the next day'),
        ('2024-05-31 24:00:00', r'\); write 00:00:00 of the next day'),
        ('45443.604166', r'counts from a date \(excel-1900: 2024-05-31 14:30:00\)'),
        ('45443,604166', r'counts from a date \(excel-1900: 2024-05-31 14:30:00\)'),
        ('1717165800', r'counts from a date \(unix-s: 2024-05-31 14:30:00\)'),
        ('7', r'counts from a date \(none is known\); write dates'),
        ('2024-05-31 14:30:00 XYZT', r'or with its zone 2024-05-31 14:30:00\+02:00'),
        ('1e999', 'is no date; write 2024-05-31'),
    ],
)
def test_a_time_that_no_clock_shows_is_refused_with_a_remedy(word: str, fault: str) -> None:
    with pytest.raises(InputError, match=rf'p\.csv: when:2: .*{fault}'):
        moments([word], 'p.csv: when')


@pytest.mark.parametrize(
    ('word', 'hour'), [('12:30 AM', 0), ('0:30 PM', 12), ('2:30 p.m.', 14), ('14:30 PM', 14)]
)
def test_hours_of_half_a_day_are_read(word: str, hour: int) -> None:
    (moment,), _ = moments([f'2024-05-31 {word}'], 'p.csv: when')
    assert moment.hour == hour


def test_a_year_of_two_digits_between_hyphens_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"is '24-05-30' in 2024 or in 2030\? write years with four"
    ):
        moments(['24-05-30 23:40:00', '24-05-31 00:20:00'], 'p.csv: when')
    (time,), _ = moments(['30.05.24 23:40:00'], 'p.csv: when')
    assert f'{time:%Y-%m-%d}' == '2024-05-30'


@pytest.mark.parametrize(
    'word',
    [
        '31. Mai 2024 14:30 Uhr',
        '31 mai 2024 à 14h30',
        '31 maj 2024 kl. 14.30',
        '31.5.2024 klo 14.30',
        '31 de mayo de 2024 14:30',
        'May 31, 2024 2:30 PM',
        '31-May-2024 14:30:00',
        'Fr. 31.05.2024 14:30',
        'vendredi 31/05/2024 14:30',
        '31/05/2024 2:30 p. m.',
        '2024\u201105\u201131\u00a014:30',
        '31/05/2024 14:30\u200b',
    ],
)
def test_dates_in_other_languages_are_read(word: str) -> None:
    (time,), _ = moments([word], 'p.csv: when', order='day-first')
    assert f'{time:%Y-%m-%d %H:%M}' == '2024-05-31 14:30'


def test_names_of_zones_are_read_that_one_zone_alone_has() -> None:
    (time,), _ = moments(['2024-05-31 14:30:00 MESZ'], 'p.csv: when')
    assert f'{time:%H:%M}' == '12:30'


def test_an_offset_and_the_name_of_its_zone_are_read() -> None:
    for word in ('2024-05-31 14:30 UTC+2', '2024-05-31T14:30:00+02:00[Europe/Oslo]'):
        (time,), _ = moments([word], 'p.csv: when')
        assert f'{time:%H:%M}' == '12:30'


@pytest.mark.parametrize(
    ('numbers', 'word'),
    [
        ('excel-1900', '45443.604225'),
        ('excel-1904', '43981.604225'),
        ('matlab', '739403,604225'),
        ('unix-s', '1717165805'),
        ('unix-ms', '1717165805000'),
        ('unix-ns', '1717165805000000000'),
        ('labview', '3800010605'),
    ],
)
def test_numbers_are_dates_of_the_program_that_a_person_names(numbers, word: str) -> None:
    (time,), _ = moments([word], 'p.csv: when', numbers=numbers)
    assert f'{time:%Y-%m-%d %H:%M:%S}' == '2024-05-31 14:30:05'
    if not numbers.startswith(('unix', 'labview')):  # the clock of the machine is a local one
        (time,), _ = moments([word], 'p.csv: when', numbers=numbers, zone='Europe/Oslo')
        assert f'{time:%H:%M:%S}' == '12:30:05'


def test_times_of_a_12_hour_clock_rise_through_noon_and_midnight() -> None:
    written = [datetime(2024, 5, 31, hour, tzinfo=UTC) for hour in (11, 12, 1, 11)]
    found = on_twelve_hours(written, '12h-am', 'p.csv')
    assert [time.hour for time in found] == [11, 12, 13, 23]
    with pytest.raises(InputError, match='hour 14 is none of a 12-hour clock'):
        on_twelve_hours([datetime(2024, 5, 31, 14, tzinfo=UTC)], '12h-am', 'p.csv')
    with pytest.raises(InputError, match='falls on a 12-hour clock too'):
        on_twelve_hours(written[::-1], '12h-pm', 'p.csv')


@pytest.mark.parametrize(
    'word',
    [
        '20240531T143000',
        '2024-W22-5T14:30:00',
        '2024-152T14:30:00',
        'Fri May 31 14:30:00 2024',
        '31-May-24 2:30:00 PM',
        '2024年5月31日 14時30分',
        '2024年5月31日 下午2:30',
        '2024년 5월 31일 14시 30분',
        '2024-05-31_14-30-00',
        '31 maja 2024 14:30',
        '31 de maio de 2024 14:30',
        "'2024-05-31 14:30",
    ],
)
def test_rare_forms_of_a_date_are_read(word: str) -> None:
    (found,), _ = moments([word], 'p.csv: datetime')
    assert found == datetime(2024, 5, 31, 14, 30, tzinfo=UTC)


def test_day_366_of_a_year_with_365_is_no_date() -> None:
    with pytest.raises(InputError, match='is no date'):
        moments(['2023-366T10:00:00'], 'log.csv: time')
