"""Tests of rates.csv: rates are read as written, and faults of a table are named."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate, later_commands
from porotwin_recording.tables.rates import measured_to, read_rates, write_rates

WELLS = ('in', 'out')


@given(
    rates_ml_h=st.lists(st.decimals(-2500, 2500, places=9).map(float), min_size=1, max_size=5),
    times=st.floats(0, 1e6),
)
def test_any_rate_in_ml_h_comes_back(
    tmp_path_factory: pytest.TempPathFactory, rates_ml_h: list[float], times: float
) -> None:
    path = tmp_path_factory.getbasetemp() / 'rates.csv'
    schedule = Schedule(
        tuple(
            ScheduleRow(times, 'in', WellRate(from_ml_h(rate_ml_h), 0.5 if rate_ml_h > 0 else 0.0))
            for rate_ml_h in rates_ml_h
        )
    )
    write_rates(path, schedule)
    assert read_rates(path, ['in']) == schedule


def test_the_round_off_of_a_sum_of_rates_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / 'rates.csv'
    exact = from_ml_h(1500.0)
    for rate in (exact, np.nextafter(exact, 0.0), np.nextafter(exact, 1.0)):
        write_rates(path, Schedule.constant({'in': WellRate(-rate)}))
        assert path.read_text().splitlines()[1] == '0,in,-1500,'
    for rate_ml_h in range(1, 2000):
        total = sum([from_ml_h(0.1 * rate_ml_h)] * 10)
        write_rates(path, Schedule.constant({'in': WellRate(total, 1.0)}))
        assert path.read_text().splitlines()[1] == f'0,in,{rate_ml_h},1'


@given(rate=st.floats(1e-12, 1e-5))
def test_any_rate_in_si_comes_back_within_its_round_off(
    tmp_path_factory: pytest.TempPathFactory, rate: float
) -> None:
    path = tmp_path_factory.getbasetemp() / 'rates_si.csv'
    write_rates(path, Schedule.constant({'in': WellRate(rate)}))
    back = read_rates(path, ['in']).at(0)['in'].rate
    assert back == pytest.approx(rate, rel=1.5e-15, abs=0.0)


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        ('time,well,rate,c\n', "first line is 'time,well,rate,c'; write time_s"),
        (
            'time_min,well,rate_ml_min,concentration\n',
            'write time_s,well,rate_ml_h,concentration; 1 min is 60 s; 1 ml/min is 60 ml/h',
        ),
        ('', "first line is ''"),
        ('time_s,well,rate_ml_h,concentration\n\n', 'no rows, so that no well ever pumps'),
        ('time_s;well;rate_ml_h;concentration\n', 'it uses semicolons: separate the columns'),
        ('time_s\twell\trate_ml_h\tconcentration\n', 'it uses tabs'),
        ('time_s,well,rate_ml_h,concentration\n0,in,5,5,1\n', ':2: .*decimal points, not commas'),
        ('time_s,well,rate_ml_h,concentration\n0,in,"5,5",1\n', ':2: .*with a decimal point'),
        ('time_s,well,rate_ml_h,concentration\n0,in,5.4D-06,1\n', 'write 5.4e-06'),
        ('time_s,well,rate_ml_h,concentration\n0,in,"1,200",1\n', 'write 1200 or 1.200'),
        ('time_s,well,rate_ml_h,concentration\n0:15,in,5,1\n', 'import reads clock times'),
        ('time_s,well,rate_ml_h,concentration\n2024-05-31,in,5,1\n', 'seconds from the start'),
        ('time_s,well,rate_ml_h,concentration\n0,out,+500,\n', 'write -500 if it takes water out'),
        ('time_s,well,rate_ml_h,concentration\n0,in,5,100\n', ':2: .*was this in percent'),
        ('time_s,well,rate_ml_h,concentration\n0,inn,1,0\n', ":2: unknown well 'inn'; .* in, out"),
        ('time_s,well,rate_ml_h,concentration\n-1,in,1,0\n', ':2: time_s -1 is negative'),
        ('time_s,well,rate_ml_h,concentration\n5,in,1,0\n1,in,2,0\n', ':3: .*sort the rows'),
        ('time_s,well,rate_ml_h,concentration\n0,in,nan,0\n', ":2: rate_ml_h is 'nan'"),
        ('time_s,well,rate_ml_h,concentration\n0,in,5_00,0\n', ":2: rate_ml_h is '5_00'"),
        ('time_s,well,rate_ml_h,concentration\n1e18,in,1,0\n', ':2: time_s 1e.18 is more than'),
        ('time_s,well,rate_ml_h,concentration\n0,in,x,0\n', ":2: rate_ml_h is 'x'"),
        ('time_s,well,rate_ml_h,concentration\n0,in,1,\n', ':2: .*nothing tells of what'),
        ('time_s,well,rate_ml_h,concentration\n0,in,1,2\n', ':2: concentration 2; must lie'),
        ('time_s,well,rate_ml_h,concentration\n0,in,1\n', ':2: has 3 values'),
        ('time_s,well,rate_ml_h,concentration\n\n0,"in,1\n', ':3: has 2 values|not readable'),
    ],
)
def test_wrong_rates_are_named(tmp_path: Path, content: str, complaint: str) -> None:
    path = tmp_path / 'rates.csv'
    path.write_text(content)
    with pytest.raises(InputError, match=complaint) as caught:
        read_rates(path, WELLS)
    assert '\n' not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_rig_without_wells_has_a_table_without_rows(tmp_path: Path) -> None:
    (tmp_path / 'rates.csv').write_text('time_s,well,rate_ml_h,concentration\n')
    assert read_rates(tmp_path / 'rates.csv', []).rows == ()


def test_rates_of_a_spreadsheet_are_read(tmp_path: Path) -> None:
    text = '\ufefftime_s,well,rate_ml_h,concentration\r\n0, out ,-10,\r\n\r\n1e1,in,5,1\r\n'
    (tmp_path / 'rates.csv').write_text(text, newline='')
    schedule = read_rates(tmp_path / 'rates.csv', WELLS)
    assert schedule.at(11) == {'out': WellRate(from_ml_h(-10)), 'in': WellRate(from_ml_h(5), 1.0)}


def test_a_table_in_utf_16_is_named(tmp_path: Path) -> None:
    (tmp_path / 'rates.csv').write_text('time_s,well,rate_ml_h,concentration\n', encoding='utf-16')
    with pytest.raises(InputError, match='save it as CSV UTF-8'):
        read_rates(tmp_path / 'rates.csv', WELLS)


def test_rates_that_are_measured_to_a_time_count_there_for_every_well() -> None:
    on, off = WellRate(1e-7), WellRate()
    measured = measured_to(Schedule.constant({'in': on, 'out': off}), 60.0)
    assert measured.rows[2:] == (ScheduleRow(60.0, 'in', on), ScheduleRow(60.0, 'out', off))
    assert measured_to(measured, 60.0) == measured
    assert later_commands(Schedule((ScheduleRow(60.0, 'out', on),)), measured) == []


def test_a_well_is_known_in_both_codings_of_its_letters(tmp_path: Path) -> None:
    path = tmp_path / 'rates.csv'
    one, two = '\u00ednj', 'i\u0301nj'
    for well, known in ((one, two), (two, one)):
        path.write_text(f'time_s,well,rate_ml_h,concentration\n0,{well},1,0\n', encoding='utf-8')
        assert [row.well for row in read_rates(path, [known, 'out']).rows] == [known]
