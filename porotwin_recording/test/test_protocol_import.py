"""Tests of imported protocols: units, clocks, dates and decimal commas of other programs."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from recording_examples import bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.importers.protocol_answers import ProtocolAnswers, concentration_in
from porotwin_recording.importers.protocol_import import import_protocols

PLAIN = ProtocolAnswers()

IMAGING = 'Image_id,Datetime\n7,2024-05-31 09:59:00\n8,2024-05-31 10:00:30\n9,2024-05-31 10:01:00\n'
INJECTION = (
    'id,location_x,location_y,start,end,rate_ml/min\n'
    '1,0.105,0.1,2024-05-31 10:00:00,2024-05-31 10:02:00,2\n'
    '2,0.3,0.2,2024-05-31 10:01:00,2024-05-31 10:02:00,-1.5\n'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with three photographs and both protocols."""
    lab = tmp_path / 'lab'
    (lab / 'images').mkdir(parents=True)
    for number in (7, 8, 9):
        (lab / 'images' / f'DSC_{number:05d}.JPG').write_bytes(b'\xff\xd8' + bytes([number]))
    (lab / 'imaging_protocol.csv').write_text(IMAGING)
    (lab / 'injection_protocol.csv').write_text(INJECTION)
    return lab


def imported(folder: Path, answers: ProtocolAnswers = PLAIN):
    """Return the recording that is made of the protocols, and what was told."""
    target = folder.parent / 'experiment'
    told = import_protocols(folder, target, bench_rig(), answers)
    return open_recording(target), told


def test_photographs_and_rates_get_times_roles_and_units(folder: Path) -> None:
    recording, told = imported(folder)
    assert [(p.time, p.role, p.read()[-1]) for p in recording.photos] == [
        (-60.0, 'baseline', 7),
        (30.0, 'state', 8),
        (60.0, 'state', 9),
    ]
    rates = {time: recording.schedule.at(time) for time in (10.0, 70.0, 130.0)}
    assert to_ml_h(rates[10.0]['in'].rate) == pytest.approx(120.0)
    assert rates[10.0]['in'].concentration == 1.0
    assert to_ml_h(rates[70.0]['out'].rate) == pytest.approx(-90.0)
    assert rates[130.0]['in'].rate == rates[130.0]['out'].rate == 0.0
    text = '\n'.join(told)
    for words in (
        'in ml/min',
        'without a zone',
        "is well 'in'",
        'taken as tracer stock',
        'time zero',
    ):
        assert words in text, words


def test_hidden_copies_of_photographs_are_no_photographs(folder: Path) -> None:
    """A file server and macOS put small files of the same names beside them."""
    images = folder / 'images'
    (images / '@eaDir').mkdir()
    for number in (7, 8, 9):
        (images / f'._DSC_{number:05d}.JPG').write_bytes(b'from macOS')
        (images / '@eaDir' / f'DSC_{number:05d}.JPG').write_bytes(b'small')
    recording, _ = imported(folder)
    assert [photo.read()[-1] for photo in recording.photos] == [7, 8, 9]


@pytest.mark.parametrize(('given', 'out'), [(1.0, 1.0), (concentration_in('in=1, out=0'), 0.0)])
def test_injections_of_two_wells_need_their_concentrations(folder: Path, given, out) -> None:
    protocol = folder / 'injection_protocol.csv'
    protocol.write_text(INJECTION.replace(',-1.5', ',1.5'))
    with pytest.raises(InputError, match="no column concentration, and 'in' and 'out' inject"):
        imported(folder)
    with pytest.raises(InputError, match="names no concentration of 'out'; add out=1"):
        imported(folder, replace(PLAIN, concentration={'in': 1.0}))
    rates = imported(folder, replace(PLAIN, concentration=given))[0].schedule.at(70.0)
    assert (rates['in'].concentration, rates['out'].concentration) == (1.0, out)


@pytest.mark.parametrize('text', ['2', 'dye', 'in=1,out', 'in=-1', 'in=1;out=0'])
def test_a_concentration_that_is_none_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(InputError, match=r'or one for each: dye=1,water=0'):
        concentration_in(text)


def test_other_names_of_columns_are_known(folder: Path) -> None:
    protocol = folder / 'injection_protocol.csv'
    protocol.write_text(INJECTION.replace('start,end', 'Start Time,Stop'))
    assert imported(folder)[0].schedule.rows[0].time == 0.0
    protocol.write_text(INJECTION.replace('location_x,location_y', 'a,b'))
    with pytest.raises(InputError, match='has no column of wells; rename one to well'):
        imported(folder.rename(folder.with_name('again')))


def test_a_pump_at_rest_does_not_start_the_clock(folder: Path) -> None:
    rest = '0,0.105,0.1,2024-05-31 09:00:00,2024-05-31 09:50:00,0\n'
    title, rows = INJECTION.split('\n', 1)
    (folder / 'injection_protocol.csv').write_text(f'{title}\n{rest}{rows}')
    recording, told = imported(folder)
    assert any('time zero is 2024-05-31 10:00:00' in line for line in told)
    assert recording.schedule.rows[0].time == 0.0


def test_the_same_protocols_as_excel_writes_them_in_europe(folder: Path) -> None:
    plain, _ = imported(folder)
    (folder / 'imaging_protocol.csv').write_bytes(
        'Path;Datetime;Bemerkung\n'
        'D:\\lab\\DSC_00007.JPG;31.05.2024 09:59:00;Küvette\n'
        'D:\\lab\\DSC_00008.JPG;31.05.2024 10:00:30;\n'
        'D:\\lab\\DSC_00009.JPG;31.05.2024 10:01:00;\n'.encode('cp1252')
    )
    (folder / 'injection_protocol.csv').write_text(
        'well;start;end;rate [µl/s];concentration\n'
        'in;31.05.2024 10:00;31.05.2024 10:02;33,333333333;1\n'
        'out;31.05.2024 10:01;31.05.2024 10:02;-25,0;0\n'
    )
    (folder.parent / 'experiment').rename(folder.parent / 'plain')
    european, _ = imported(folder)
    assert [p.time for p in european.photos] == [p.time for p in plain.photos]
    for time in (10.0, 70.0, 130.0):
        for well, rate in plain.schedule.at(time).items():
            assert european.schedule.at(time)[well].rate == pytest.approx(rate.rate, rel=1e-6)


@pytest.mark.parametrize(
    ('change', 'question'),
    [
        (('2024-05-31', '03/04/2024'), '--date-order'),
        (('rate_ml/min', 'rate'), '--rate-unit'),
        (('rate_ml/min', 'rate_sccm'), 'of a gas'),
        (('0.105', '0.2'), 'cm away'),
        (('10:02:00,2', '09:02:00,2'), 'not after its start'),
        (('0.3,0.2', '0.1,0.1'), 'overlap at'),
        (('2024-05-31 10:00:00,', '2024-05-31 10:00:00Z,'), 'some times have a zone'),
        (('2024-05-31 10:00:00', '1970-01-01 00:00:00'), ":2: '1970.* a year from '2024"),
        (('2024-05-31 10:00:00', '0001-01-01 00:00:00'), 'correct the year'),
        (('rate_ml/min', 'start'), "columns 4 and 6 are both titled 'start'"),
        (('id,location_x', 'rate set,location_x'), "meant, 'rate set' or 'rate_ml/min'"),
        (('id,location_x', 'start [utc],location_x'), r"meant, 'start \[utc\]' or 'start'"),
    ],
)
def test_every_ambiguity_and_fault_is_asked_for_in_one_line(
    folder: Path, change: tuple[str, str], question: str
) -> None:
    (folder / 'injection_protocol.csv').write_text(INJECTION.replace(*change))
    with pytest.raises(InputError, match=question) as refusal:
        imported(folder)
    assert '\n' not in str(refusal.value)
    assert not (folder.parent / 'experiment').exists()


def test_a_comma_before_three_digits_may_be_a_decimal_one(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(
        'well,start,end,rate (ml/h)\nin,2024-05-31 10:00,2024-05-31 10:02,"1,500"\n'
    )
    with pytest.raises(InputError, match=r"is '1,500' 1\.500 or 1500\? give --decimal comma"):
        imported(folder)
    recording, _ = imported(folder, ProtocolAnswers(decimal='point'))
    assert to_ml_h(recording.schedule.at(1.0)['in'].rate) == pytest.approx(1500.0)


def test_places_may_have_decimal_commas(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(
        'location;start;end;rate [ml/h]\n'
        '"(0,105; 0,1)";2024-05-31 10:00;2024-05-31 10:02;1,5\n'
        '"(0.3, 0.2)";2024-05-31 10:00;2024-05-31 10:02;-1,5\n'
    )
    recording, _ = imported(folder)
    assert set(recording.schedule.at(1.0)) == {'in', 'out'}


@pytest.mark.parametrize('ahead', [float('nan'), float('inf'), 1e15, -1e11])
def test_a_lead_of_the_camera_beyond_a_year_is_refused(folder: Path, ahead: float) -> None:
    with pytest.raises(InputError, match=r'--camera-ahead .*: give the lead .* at most a year'):
        imported(folder, ProtocolAnswers(camera_ahead_s=ahead))


@pytest.mark.parametrize('title', ['image_id', 'path'])
def test_a_camera_that_set_itself_back_is_refused(folder: Path, title: str) -> None:
    words = [str(n) if title == 'image_id' else f'x/DSC_{n:05d}.JPG' for n in (7, 8, 9)]
    times = ('02:30', '02:50', '02:10')
    lines = [f'{word},2026-10-25 {time}' for word, time in zip(words, times, strict=True)]
    protocol = folder / 'imaging_protocol.csv'
    protocol.write_text('\n'.join([f'{title},datetime', *lines]))
    (folder / 'injection_protocol.csv').unlink()
    with pytest.raises(InputError, match=r"datetime:4: '2026-10-25 02:10' of photograph 9"):
        imported(folder)
    zones = ('+02:00', '+02:00', '+01:00')
    lines = [line + zone for line, zone in zip(lines, zones, strict=True)]
    protocol.write_text('\n'.join([f'{title},datetime', *lines]))
    recording, _ = imported(folder)
    assert [photo.time for photo in recording.photos] == [0.0, 1200.0, 2400.0]


def test_answers_settle_what_is_open(folder: Path) -> None:
    for name in ('imaging_protocol.csv', 'injection_protocol.csv'):
        text = (folder / name).read_text().replace('2024-05-31 10', '3/4/24 1')
        text = text.replace('2024-05-31 09:59:00', '3/4/24 0:59:00 PM').replace(
            'rate_ml/min', 'rate'
        )
        for second in ('00', '30'):
            text = text.replace(f':{second},', f':{second} PM,').replace(
                f':{second}\n', f':{second} PM\n'
            )
        (folder / name).write_text(text)
    answers = ProtocolAnswers(
        'day-first', 'Europe/Oslo', rate_unit='l/h', concentration=0.5, camera_ahead_s=2.0
    )
    recording, told = imported(folder, answers)
    assert [p.time for p in recording.photos] == [-62.0, 28.0, 58.0]
    assert to_ml_h(recording.schedule.at(1.0)['in'].rate) == pytest.approx(2000.0)
    assert recording.schedule.at(1.0)['in'].concentration == 0.5
    assert 'time zero is 2024-04-03 11:00:00 UTC' in told  # summer time in Oslo


def test_photographs_that_are_not_there_are_counted(folder: Path) -> None:
    (folder / 'images' / 'DSC_00008.JPG').unlink()
    recording, told = imported(folder, replace(PLAIN, concentration=1.0))
    assert len(recording.photos) == 2
    assert any("1 of 3 photographs are not there and left out, the first is '8'" in t for t in told)


def test_protocols_of_which_only_one_names_its_zone_are_refused(folder: Path) -> None:
    text = INJECTION.replace(':00,', ':00Z,')
    (folder / 'injection_protocol.csv').write_text(text)
    with pytest.raises(InputError, match=r'imaging_protocol.csv: .* no zone.*--time-zone'):
        imported(folder)
    recording, _ = imported(folder, replace(PLAIN, time_zone='Europe/Oslo'))
    assert [p.time for p in recording.photos] == [-7260.0, -7170.0, -7140.0]


def test_counts_in_utc_beside_a_clock_without_a_zone_are_refused(folder: Path) -> None:
    text = INJECTION
    for minute in range(3):
        moment = datetime(2024, 5, 31, 10, minute, tzinfo=UTC)
        text = text.replace(f'{moment:%Y-%m-%d %H:%M:%S}', f'{moment.timestamp():.0f}')
    (folder / 'injection_protocol.csv').write_text(text)
    answers = replace(PLAIN, date_numbers='unix-s')
    with pytest.raises(InputError, match=r'imaging_protocol.csv: .* no zone.*--time-zone'):
        imported(folder, answers)
    recording, _ = imported(folder, replace(answers, time_zone='Europe/Oslo'))
    assert [p.time for p in recording.photos] == [-7260.0, -7170.0, -7140.0]


def test_a_duration_in_place_of_an_end_is_refused(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(
        'well,start,Duration [s],rate_ml/min\nin,2024-05-31 10:00:00,120,2\n'
    )
    with pytest.raises(InputError, match=r'Duration \[s\] is not read; add a column end'):
        imported(folder)


def test_a_producing_row_needs_no_concentration(folder: Path) -> None:
    lines = [
        line + end
        for line, end in zip(INJECTION.splitlines(), (',concentration', ',0.5', ','), strict=True)
    ]
    (folder / 'injection_protocol.csv').write_text('\n'.join(lines))
    recording, told = imported(folder)
    assert recording.schedule.at(70.0)['in'].concentration == 0.5
    assert not any('left out' in line for line in told)
    (folder / 'injection_protocol.csv').write_text('\n'.join([*lines[:2], f'{lines[2]}1']))
    (folder.parent / 'experiment').rename(folder.parent / 'third')
    assert any('concentration is left out where' in line for line in imported(folder)[1])
    (folder / 'injection_protocol.csv').write_text('\n'.join(lines).replace(',0.5', ','))
    (folder.parent / 'experiment').rename(folder.parent / 'other')
    with pytest.raises(InputError, match=r"csv:2: concentration is ''; write a number"):
        imported(folder)


MEASURED = (
    'well;time;flow [ml/h]\n'
    'in;31.05.2024 09:59:50;0\n'
    'in;31.05.2024 10:00:10;117,5\n'
    'in;31.05.2024 10:02:00;0\n'
    'out;31.05.2024 10:01:00;-88\n'
)


def test_the_log_of_a_flow_meter_becomes_measured_rates(folder: Path) -> None:
    injection = INJECTION.replace('rate_ml/min', 'rate_ml/min,concentration')
    injection = injection.replace(':00,2\n', ':00,2,0.5\n').replace(',-1.5\n', ',-1.5,0\n')
    (folder / 'injection_protocol.csv').write_text(injection)
    (folder / 'measured_protocol.csv').write_text(MEASURED)
    recording, told = imported(folder, replace(PLAIN, date_order='day-first'))
    measured = recording.measured
    assert measured is not None
    assert measured.rows[0].time == 0.0
    assert measured.at(5.0)['in'].rate == 0.0  # began at -10 s
    assert to_ml_h(measured.at(60.0)['in'].rate) == pytest.approx(117.5)
    assert measured.at(60.0)['in'].concentration == 0.5  # as commanded
    assert to_ml_h(measured.at(500.0)['out'].rate) == pytest.approx(-88.0)  # the last row holds
    assert measured.at(500.0)['in'].rate == 0.0
    assert 'every rate holds until the next row of its well' in '\n'.join(told)
    assert 'no column concentration: injection_protocol.csv tells it' in '\n'.join(told)


CHASED = (
    'well,start,end,rate_ml/min,concentration\n'
    'in,2024-05-31 10:00,2024-05-31 10:30,3,1\n'
    'in,2024-05-31 10:30,2024-05-31 10:45,3,0\n'
    'out,2024-05-31 10:00,2024-05-31 10:45,-3,\n'
)
"""Stock, then water from the same pump."""


def test_measured_rates_are_split_where_the_commanded_concentration_changes(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(CHASED)
    (folder / 'measured_protocol.csv').write_text(
        'start,well,rate [ml/min]\n'
        '2024-05-31 10:00,in,2.9\n'
        '2024-05-31 10:15,in,2.95\n'
        '2024-05-31 10:45,in,0\n'
    )
    recording, _ = imported(folder)
    measured = recording.measured
    assert measured is not None
    shares = [(row.time, row.rate.concentration) for row in measured.rows]
    assert shares == [(0.0, 1.0), (900.0, 1.0), (1800.0, 0.0), (2700.0, 0.0)]
    assert to_ml_h(measured.at(1800.0)['in'].rate) == pytest.approx(177.0)
    stock = recording.delivered.injected_stock(0.0, 2700.0)
    assert stock == pytest.approx(1e-6 * (15 * 2.9 + 15 * 2.95))


def test_a_measured_log_is_not_split_after_its_end(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(CHASED)
    (folder / 'measured_protocol.csv').write_text(
        'start,well,rate [ml/min]\n2024-05-31 10:00,in,2.9\n2024-05-31 10:20,out,-2.9\n'
    )
    recording, _ = imported(folder)
    assert recording.measured is not None
    assert [row.time for row in recording.measured.rows] == [0.0, 1200.0]
    after = recording.delivered.at(1800.0)['in']  # as commanded, after the end of the log
    assert (to_ml_h(after.rate), after.concentration) == (pytest.approx(180.0), 0.0)


def test_after_the_end_of_a_measured_log_with_ends_the_commanded_rates_count(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(CHASED)
    (folder / 'measured_protocol.csv').write_text(
        'start,end,well,rate [ml/min]\n'
        '2024-05-31 10:00,2024-05-31 10:20,in,2.9\n'
        '2024-05-31 10:00,2024-05-31 10:19,out,-2.9\n'
    )
    recording, _ = imported(folder)
    for time, wells in ((1150.0, (174.0, 0.0)), (1200.0, (180.0, -180.0)), (2700.0, (0.0, 0.0))):
        found = [to_ml_h(recording.delivered.at(time)[well].rate) for well in ('in', 'out')]
        assert found == pytest.approx(wells)


def test_measured_rates_before_the_first_command_are_told(folder: Path) -> None:
    (folder / 'measured_protocol.csv').write_text(MEASURED.replace('59:50;0', '59:50;30'))
    recording, told = imported(folder, replace(PLAIN, date_order='day-first'))
    assert recording.measured is not None
    assert to_ml_h(recording.measured.at(5.0)['in'].rate) == pytest.approx(30.0)
    assert (
        'measured_protocol.csv: 1 rates begin before the first of injection_protocol.csv'
        in '\n'.join(told)
    )


def test_without_commands_the_measured_log_gives_the_rates(folder: Path) -> None:
    (folder / 'injection_protocol.csv').unlink()
    (folder / 'measured_protocol.csv').write_text(MEASURED)
    recording, _ = imported(folder, replace(PLAIN, date_order='day-first'))
    assert recording.commanded is None
    assert recording.measured is not None
    assert recording.measured.rows[0].time == 0.0


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        (
            (';-88', ';88'),
            "rates of 'out' have the other sign in injection_protocol.csv; write",
        ),
        (('31.05.', '01.06.'), 'has no rate in the time of injection_protocol.csv; compare their'),
        (('31.05.', '30.05.'), 'has no rate in the time of injection_protocol.csv'),
        (('31.05.2024', '31.05.2023'), 'has no rate in the time of injection_protocol.csv'),
    ],
)
def test_a_measured_log_of_another_sign_or_day_is_refused(folder: Path, change, complaint) -> None:
    (folder / 'measured_protocol.csv').write_text(MEASURED.replace(*change))
    with pytest.raises(InputError, match=complaint):
        imported(folder, replace(PLAIN, date_order='day-first'))


def test_an_imported_recording_has_the_date_of_its_protocols(folder: Path) -> None:
    recording, _ = imported(folder)
    dated = datetime.fromtimestamp((recording.source / 'rates.csv').stat().st_mtime, UTC)
    assert dated == datetime(2024, 5, 31, 10, tzinfo=UTC)


def test_converted_rates_have_no_rounding_errors(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(INJECTION.replace(',-1.5', ',-8.5'))
    recording, _ = imported(folder)
    assert ',out,-510,' in (recording.source / 'rates.csv').read_text()


@pytest.mark.parametrize(
    ('change', 'rate_ml_h', 'complaint'),
    [
        (('rate_ml/min', 'rate [g/min],density [g/cm3]'), 120.0 / 0.8, ''),
        (('rate_ml/min', 'rate [g/min],density'), None, ':2: density: 0.8 kg/m3 is no density'),
        (('rate_ml/min', 'rate [g/min],density [lb]'), None, "'lb' is no unit of a density"),
    ],
)
def test_densities_have_units(folder: Path, change, rate_ml_h, complaint: str) -> None:
    text = INJECTION.replace(*change).replace(':00,2\n', ':00,2,0.8\n').replace('-1.5', '-1.5,0.8')
    (folder / 'injection_protocol.csv').write_text(text)
    if complaint:
        with pytest.raises(InputError, match=complaint):
            imported(folder)
    else:
        recording, _ = imported(folder)
        assert to_ml_h(recording.schedule.at(10.0)['in'].rate) == pytest.approx(rate_ml_h)


@pytest.mark.parametrize(
    ('title', 'value', 'share', 'complaint'),
    [
        ('concentration [%]', '50', 0.5, ''),
        ('concentration', '100', None, 'concentration is 100; write a share of the tracer stock'),
        ('concentration [g/l]', '1', None, "'g/l' is no share of the tracer stock; write shares"),
    ],
)
def test_concentrations_have_units(folder: Path, title, value, share, complaint: str) -> None:
    text = INJECTION.replace('rate_ml/min', f'rate_ml/min,{title}')
    text = text.replace(':00,2\n', f':00,2,{value}\n').replace('-1.5', '-1.5,')
    (folder / 'injection_protocol.csv').write_text(text)
    if complaint:
        with pytest.raises(InputError, match=re.escape(complaint)):
            imported(folder)
    else:
        assert imported(folder)[0].schedule.at(10.0)['in'].concentration == share


def test_a_photograph_that_may_be_one_of_two_files_is_refused(folder: Path) -> None:
    (folder / 'imaging_protocol.csv').write_text(
        'path,datetime\nday3/DSC_00007.JPG,2024-05-31 09:59:00\nDSC_00008.JPG,2024-05-31 10:00:30\n'
    )
    for day in ('day1', 'day2'):
        (folder / day).mkdir()
        (folder / day / 'DSC_00007.JPG').write_bytes(b'\xff\xd8\x07')
    (folder / 'images' / 'DSC_00007.JPG').unlink()
    with pytest.raises(InputError, match=r"'day3/DSC_00007.JPG' may be .*day1.* or .*day2"):
        imported(folder)


def test_two_rows_for_one_photograph_are_refused(folder: Path) -> None:
    (folder / 'imaging_protocol.csv').write_text(IMAGING.replace('\n9,', '\n8,'))
    with pytest.raises(InputError, match=r'two rows mean .*DSC_00008\.JPG'):
        imported(folder)


def test_a_zone_in_one_of_two_columns_is_asked_for(folder: Path) -> None:
    (folder / 'imaging_protocol.csv').unlink()
    text = INJECTION.replace('2024-05-31 10:02:00', '2024-05-31 10:02:00-05:00')
    (folder / 'injection_protocol.csv').write_text(text)
    with pytest.raises(InputError, match='only one of start and end names a time zone'):
        imported(folder)


def test_gaps_of_a_measured_log_are_told(folder: Path) -> None:
    (folder / 'measured_protocol.csv').write_text(
        'well,start,end,rate_ml/min\n'
        'in,2024-05-31 10:00:00,2024-05-31 10:00:30,2\n'
        'in,2024-05-31 10:01:00,2024-05-31 10:02:00,2\n'
    )
    _, told = imported(folder)
    assert '1 gaps between rates count as a stopped pump, the first at 2024-05-31 10:00:30' in (
        '\n'.join(told)
    )


def test_an_assumption_about_the_clock_is_told_once(folder: Path) -> None:
    (folder / 'measured_protocol.csv').write_text(INJECTION)
    _, told = imported(folder)
    assert ['zone' in line for line in told].count(True) == 1


def test_titles_are_told_as_the_file_spells_them(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(INJECTION.replace('start', 'Wann'))
    with pytest.raises(InputError, match='columns are id, location_x, location_y, Wann, end'):
        imported(folder)
    (folder / 'injection_protocol.csv').write_text(
        INJECTION.replace('rate_ml/min', 'Rate [ml/min]').replace(',2\n', ',two\n')
    )
    with pytest.raises(InputError, match=r"csv:2: Rate \[ml/min\] is 'two'; write a number, its"):
        imported(folder)


def test_a_producing_pump_without_a_minus_is_asked_for_it(folder: Path) -> None:
    (folder / 'injection_protocol.csv').write_text(CHASED.replace('-3,', '3,'))
    with pytest.raises(
        InputError, match=r"concentration is ''; .* or a negative rate if this well"
    ):
        imported(folder)


def test_maps_beside_protocols_are_told_to_be_left_out(folder: Path) -> None:
    (folder / 'maps.nc').write_bytes(b'')
    _, told = imported(folder)
    assert any(line.startswith('maps.nc: not read') for line in told)
