"""Photographs without a list: their times are in the files or in the names."""

from dataclasses import replace
from pathlib import Path

import pytest
from recording_examples import bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.importers.protocol_answers import ProtocolAnswers
from porotwin_recording.importers.protocol_import import import_protocols, is_lab_folder
from porotwin_recording.tables.photos import Photo

PLAIN = ProtocolAnswers()
PUMPS = (
    'well,start,end,rate [ml/h],concentration\nin,2024-05-31 10:00:00,2024-05-31 10:30:00,100,1\n'
)
NO_FILE = ''
"""The time of a photograph into which no camera wrote one."""


def imported(
    folder: Path, words: dict[str, str], *, pumps: str = PUMPS, answers: ProtocolAnswers = PLAIN
) -> tuple[tuple[Photo, ...], str]:
    """Return the photographs and the lines about them.

    Args:
        folder: an empty folder.
        words: the times that a camera wrote, by the paths of the files.
        pumps: the pump log; '' for none.
        answers: the answers of a person.
    """
    source, target = folder / 'lab', folder / 'experiment'
    for name in words:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes(b'\xff\xd8' + name.encode())
    if pumps:
        (source / 'injection_protocol.csv').write_text(pumps)
    assert is_lab_folder(source)
    told = import_protocols(
        source,
        target,
        bench_rig(),
        answers,
        exposure=lambda path: words[str(path.relative_to(source))],
    )
    return open_recording(target).photos, '\n'.join(told)


def test_photographs_have_the_times_that_the_camera_wrote(tmp_path: Path) -> None:
    words = {
        'DCIM/IMG_0012.JPG': '2024-05-31 10:05:00.75',
        'DCIM/IMG_0010.JPG': '2024-05-31 09:59:00',
        'DCIM/IMG_0011.JPG': '2024-05-31 10:05:00.25',
        '._IMG_0010.JPG': NO_FILE,  # a file of macOS
    }
    photos, told = imported(tmp_path, words)
    assert [(photo.time, photo.role) for photo in photos] == [
        (-60.0, 'baseline'),
        (300.25, 'state'),
        (300.75, 'state'),
    ]
    assert photos[1].read().endswith(b'IMG_0011.JPG')
    assert (
        'photographs with times in EXIF: 3, from 2024-05-31 09:59:00 to 2024-05-31 10:05:00' in told
    )


def test_without_a_pump_log_the_first_photograph_is_the_baseline_at_zero(tmp_path: Path) -> None:
    words = {'IMG_0001.JPG': '2024-05-31 10:05:00', 'IMG_0002.JPG': '2024-05-31 10:06:00'}
    photos, told = imported(tmp_path, words, pumps='')
    assert [(photo.time, photo.role) for photo in photos] == [(0.0, 'baseline'), (60.0, 'state')]
    assert 'no pump log: IMG_0001.JPG is taken as the baseline' in told


def test_offsets_need_the_zone_of_the_pump_log(tmp_path: Path) -> None:
    words = {'IMG_0001.JPG': '2024-05-31 09:59:00+02:00', 'IMG_0002.JPG': '2024-05-31 08:05+00:00'}
    with pytest.raises(InputError, match=r'injection_protocol\.csv: the times name no zone.*give'):
        imported(tmp_path / 'one', words)
    answers = replace(PLAIN, time_zone='Europe/Oslo', camera_ahead_s=10.0)
    photos, told = imported(tmp_path / 'two', words, answers=answers)
    assert [photo.time for photo in photos] == [-70.0, 290.0]
    assert 'time zero is 2024-05-31 08:00:00 UTC' in told


def test_times_in_names_count_if_files_hold_none(tmp_path: Path) -> None:
    words = {
        'IMG_20240531_095900.jpg': NO_FILE,
        'PXL_20240531_100500250.jpg': '2024-05-31 10:05:00',
        'timelapse 2024-05-31 10.06.00.png': NO_FILE,
        'sands.png': NO_FILE,
    }
    photos, told = imported(tmp_path, words)
    assert [photo.time for photo in photos] == [-60.0, 300.0, 360.0]
    assert 'photographs with times in names: 3' in told


def test_photographs_without_a_time_are_left_out_and_named(tmp_path: Path) -> None:
    words = {
        'IMG_0001.JPG': '2024-05-31 09:59:00',
        'IMG_0002.JPG': NO_FILE,
        'IMG_0003.JPG': '2024-05-31 10:05:00',
    }
    photos, told = imported(tmp_path / 'some', words)
    assert len(photos) == 2
    assert '1 of 3 photographs hold no time and are left out, the first is IMG_0002.JPG' in told
    none = dict.fromkeys(words, NO_FILE)
    assert not imported(tmp_path / 'pumps', none)[0]
    with pytest.raises(InputError, match=r'no photograph holds its time; list .*_protocol\.csv'):
        imported(tmp_path / 'nothing', none, pumps='')


@pytest.mark.parametrize(
    ('words', 'fault'),
    [
        (
            {'IMG_0001.JPG': '2024-05-31 09:59:00', 'IMG_0001 (1).JPG': '2024-05-31 09:59:00'},
            r'IMG_0001 \(1\)\.JPG and .*IMG_0001\.JPG have the same time 2024-05-31 09:59:00',
        ),
        (
            {'IMG_0001.JPG': '2024-10-27 02:50:00', 'IMG_0002.JPG': '2024-10-27 02:10:00'},
            r'IMG_0002\.JPG: its EXIF time .* is earlier than 02:50:00 of IMG_0001.*--time-zone',
        ),
        (
            {'IMG_0001.JPG': '2024-05-31 10:00:00+02:00', 'IMG_0002.JPG': '2024-05-31 10:05:00'},
            r'IMG_0002\.JPG: its EXIF time has no zone',
        ),
        (
            {'IMG_0001.JPG': '2016-01-01 00:00:00', 'IMG_0002.JPG': '2016-01-01 00:05:00'},
            r'IMG_0001\.JPG: taken at 2016-01-01 00:00:00, more than a year from the first',
        ),
        (
            {
                'IMG_20240531_095900.jpg': '2024-05-31 09:59:00',
                'IMG_20240531_100500.jpg': '2024-05-31 10:15:00',
                'IMG_20240531_100600.jpg': '2024-05-31 10:06:00',
            },
            r'100500\.jpg: its EXIF time is 2024-05-31 10:15:00, its name says 2024-05-31 10:05:00',
        ),
    ],
    ids=['copy', 'set back', 'zones', 'never set', 'name'],
)
def test_times_that_contradict_each_other_are_refused(
    tmp_path: Path, words: dict[str, str], fault: str
) -> None:
    with pytest.raises(InputError, match=fault):
        imported(tmp_path, words)


def test_one_lag_of_all_names_is_told(tmp_path: Path) -> None:
    words = {
        'IMG_20240531_115900.jpg': '2024-05-31 09:59:00',
        'IMG_20240531_120501.jpg': '2024-05-31 10:05:00',
    }
    photos, told = imported(tmp_path, words)
    assert [photo.time for photo in photos] == [-60.0, 300.0]
    assert 'EXIF times count; names say 7200 s to 7201 s more' in told


def test_photographs_before_all_pumps_are_told(tmp_path: Path) -> None:
    words = {'IMG_0001.JPG': '2024-05-31 07:59:00', 'IMG_0002.JPG': '2024-05-31 08:05:00'}
    _, told = imported(tmp_path, words)
    assert 'all photographs are older than the first injection' in told


def with_rates(folder: Path, time_zero: str, words: dict[str, str]) -> tuple[Photo, ...]:
    """Return the imported photographs of a folder with a rates.csv."""
    (folder / 'lab').mkdir(exist_ok=True)
    (folder / 'lab' / 'rates.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n60,in,100,1\n1800,in,0,1\n'
    )
    photos, _ = imported(folder, words, pumps='', answers=ProtocolAnswers(time_zero=time_zero))
    return photos


MORNING = {'a.jpg': '2024-05-31 09:59:00', 'b.jpg': '2024-05-31 10:05:00'}


def test_rates_in_seconds_are_joined_to_photographs(tmp_path: Path) -> None:
    photos = with_rates(tmp_path, '2024-05-31 10:00', MORNING)
    assert [(photo.time, photo.role) for photo in photos] == [(-60.0, 'baseline'), (300.0, 'state')]
    commanded = open_recording(tmp_path / 'experiment').commanded
    assert commanded is not None
    assert [row.time for row in commanded.rows] == [60.0, 1800.0]


@pytest.mark.parametrize(
    ('time_zero', 'told'),
    [
        ('', r'rates.csv: counts seconds; give --time-zero'),
        ('2024-05-31', "--time-zero '2024-05-31': has no time of day"),
        ('noon', "--time-zero: 'noon' is no date"),
        ('2022-05-31 10:00', 'more than a year'),
        ('2024-05-31 10:00Z', 'the times name no zone, unlike those of --time-zero'),
    ],
)
def test_a_time_zero_that_cannot_be_used_is_refused(
    tmp_path: Path, time_zero: str, told: str
) -> None:
    with pytest.raises(InputError, match=told):
        with_rates(tmp_path, time_zero, MORNING)


def test_a_pump_log_has_a_time_zero_of_its_own(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='leave the option out'):
        imported(tmp_path, MORNING, answers=ProtocolAnswers(time_zero='2024-05-31 10:00'))
    (tmp_path / 'lab' / 'rates.csv').write_text('time_s,well,rate_ml_h,concentration\n0,in,1,1\n')
    with pytest.raises(InputError, match=r'has injection_protocol.csv and rates.csv'):
        imported(tmp_path, MORNING)


def test_an_experiment_is_no_lab_folder(tmp_path: Path) -> None:
    (tmp_path / 'IMG_0001.JPG').write_bytes(b'')
    assert is_lab_folder(tmp_path)
    (tmp_path / 'imaging.csv').write_text('time_s,path,role\n0,IMG_0001.JPG,baseline\n')
    assert not is_lab_folder(tmp_path)


def test_a_photograph_without_a_time_is_left_out_and_names_count_if_more_of_them_hold_one(
    tmp_path: Path,
) -> None:
    named = {'IMG_20240531_095900.jpg': NO_FILE, 'IMG_20240531_100500.jpg': NO_FILE}
    wrong = {'IMG_20241331_101000.jpg': NO_FILE, 'sketch/notes.jpg': NO_FILE}
    photos, told = imported(tmp_path / 'a', named | wrong)
    assert [photo.time for photo in photos] == [-60.0, 300.0]
    assert '2 of 4 photographs hold no time and are left out' in told
    other = {'IMG_20240531_101000.jpg': '2022-05-31 10:10:00'}
    photos, told = imported(tmp_path / 'b', named | other)
    assert [photo.time for photo in photos] == [-60.0, 300.0, 600.0]
    assert 'EXIF times of 1 photographs, such as IMG_20240531_101000.jpg, are not used' in told


def test_photographs_before_the_first_rate_are_baselines(tmp_path: Path) -> None:
    later = {**MORNING, 'c.jpg': '2024-05-31 10:00:30'}
    photos = with_rates(tmp_path, '2024-05-31 10:00', later)
    roles = [(photo.time, photo.role) for photo in photos]
    assert roles == [(-60.0, 'baseline'), (30.0, 'baseline'), (300.0, 'state')]


def test_copies_of_programs_are_left_out_and_unread_formats_told(tmp_path: Path) -> None:
    words = {
        'IMG_0001.JPG': '2024-05-31 09:59:00',
        '.thumbnails/IMG_0001.JPG': '2024-05-31 09:59:00',
        '@eaDir/IMG_0001.JPG': '2024-05-31 09:59:00',
        'IMG_0002.HEIC': NO_FILE,
    }
    photos, told = imported(tmp_path, words)
    assert len(photos) == 1
    assert "other formats are left out (1, such as 'IMG_0002.HEIC'); save them as JPEG" in told


def test_photographs_of_long_before_are_told(tmp_path: Path) -> None:
    words = {'IMG_0001.JPG': '2024-05-27 09:59:00', 'IMG_0002.JPG': '2024-05-31 09:59:00'}
    _, told = imported(tmp_path, words)
    assert "6 h before the first injection (1, such as 'IMG_0001.JPG') count as baselines" in told
