"""Tests of the date of a recording."""

import os
from datetime import datetime

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.recording_date import date_of_files, parse_date


def test_the_earliest_file_of_a_recording_dates_it(tmp_path):
    for name, stamp in (('rates.csv', 1.7e9), ('imaging.csv', 1.7e9 + 60), ('maps.png', 1.0)):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (stamp, stamp))
    assert date_of_files(tmp_path).timestamp() == 1.7e9
    assert date_of_files(tmp_path / 'rates.csv').timestamp() == 1.7e9
    with pytest.raises(InputError, match='name a recording that exists'):
        date_of_files(tmp_path / 'nowhere')


def test_a_day_is_local_time():
    assert parse_date('2026-11-23') == datetime(2026, 11, 23).astimezone()
    assert parse_date('2026-11-23T10:00:00+00:00').timestamp() == 1795428000.0
    with pytest.raises(InputError, match='is no date'):
        parse_date('Monday')
