"""./porotwin calibrate: unusable photographs, rates and places of the output."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_examples import porotwin

from porotwin_cli.commands import calibrate
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.one_writer import only_writer


@pytest.mark.parametrize('role', ['baseline', 'state'])
def test_photographs_of_another_size_are_named(experiment: Path, tmp_path: Path, role: str) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    rows = [line.split(',') for line in (folder / 'imaging.csv').read_text().splitlines()[1:]]
    changed = [row[1] for row in rows if row[2] == role]
    if role == 'baseline':  # a second baseline
        with (folder / 'imaging.csv').open('a') as table:
            table.write('1,second.png,baseline\n')
        shutil.copy(folder / changed[0], folder / 'second.png')
        changed = ['second.png']
    for name in changed:
        picture = cv2.imread(str(folder / name))
        cv2.imwrite(str(folder / name), picture[::2, ::2])
    result = porotwin('calibrate', folder)
    assert result.returncode == 2
    assert f'{folder / changed[0]}: photograph of 320 x' in result.stderr


@pytest.fixture
def copied(experiment: Path, tmp_path: Path) -> Path:
    """Return a copy of the experiment that may be changed."""
    return Path(shutil.copytree(experiment, tmp_path / 'monday'))


def test_an_early_refusal_tells_why_and_shows_no_older_picture(copied: Path) -> None:
    older = copied.with_name('monday-calibration')
    older.mkdir()
    for name in ('refused.txt', '6_mass.png'):
        (older / name).touch()
    states = [photo.name for photo in open_recording(copied).photos if photo.role == 'state']
    for name in states:
        cv2.imwrite(str(copied / name), np.zeros_like(cv2.imread(str(copied / name))))
    result = porotwin('calibrate', copied)
    assert result.returncode == 1
    *lines, last = result.stderr.splitlines()
    assert f'none of {len(states)} photographs of the injection can be used' in last
    assert 'the first one, at 30 s: photograph is black' in last
    assert 'photograph the injection again' in last
    assert '6_mass.png' not in last
    assert sum('left out: photograph is black' in line for line in lines) == len(states)


def test_an_injection_without_tracer_tells_the_photographs_that_were_left_out(copied: Path) -> None:
    baseline, first, *others = open_recording(copied).photos
    for photo in others:
        shutil.copy(copied / baseline.name, copied / photo.name)
    cv2.imwrite(str(copied / first.name), np.zeros_like(cv2.imread(str(copied / first.name))))
    result = porotwin('calibrate', copied)
    assert result.returncode == 1
    *lines, last = result.stderr.splitlines()
    assert 'no photograph shows tracer' in last
    assert any('left out: photograph is black' in line for line in lines)


def test_the_default_output_lies_beside_the_experiment(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = copied.with_name('monday-calibration')
    assert calibrate._beside(copied) == beside
    assert calibrate._beside(copied / 'rig.yaml') == beside
    monkeypatch.chdir(copied)
    assert calibrate._beside(Path('.')) == beside  # noqa: PTH201  as a user writes it
    assert calibrate._beside(Path('rig.yaml')) == beside
    (copied / 'photos').mkdir(exist_ok=True)
    monkeypatch.chdir(copied / 'photos')
    assert calibrate._beside(Path('..')) == beside
    monkeypatch.chdir(copied.parent)
    assert calibrate._beside(Path('monday')) == Path('monday-calibration')


def test_a_file_that_is_no_recording_is_refused_with_a_line(copied: Path) -> None:
    result = porotwin('calibrate', copied / 'rates.csv')
    assert result.returncode == 2
    assert 'rates.csv: is no recording; name an experiment folder or an MCAP bag' in result.stderr


def test_an_output_that_cannot_be_written_is_refused_before_the_work(copied: Path) -> None:
    for output in (copied / 'rates.csv' / 'new', Path('/proc/absent/new')):
        result = porotwin('calibrate', copied, '--output', output)
        assert result.returncode == 2
        assert f'{output}: cannot be written' in result.stderr
        assert 'photograph at' not in result.stderr


def test_two_calls_do_not_write_one_calibration(copied: Path, tmp_path: Path) -> None:
    output = tmp_path / 'calibration'
    with only_writer(output):
        result = porotwin('calibrate', copied, '--output', output)
    assert result.returncode == 2
    assert f'{output}: is being written by another call' in result.stderr
    assert 'photograph at' not in result.stderr


def test_commanded_rates_count_before_the_first_measurement(copied: Path) -> None:
    commanded, name = calibrate._injected_rates(open_recording(copied))
    assert name == 'rates.csv'
    assert commanded == open_recording(copied).commanded
    (copied / 'rates_measured.csv').write_text(
        'time_s,well,rate_ml_h,concentration\n90,injector,600,1\n90,producer,-600,\n'
    )
    schedule, name = calibrate._injected_rates(open_recording(copied))
    assert name == 'rates_measured.csv'
    assert commanded is not None
    assert schedule is not None
    assert schedule.rows[: len(commanded.rows)] == commanded.rows
    assert schedule.at(100.0)['injector'].rate == pytest.approx(1.2 * commanded.rows[0].rate.rate)


def test_without_rates_there_is_no_pump_log(copied: Path) -> None:
    (copied / 'rates.csv').unlink()
    assert calibrate._injected_rates(open_recording(copied)) == (None, 'rates.csv')
