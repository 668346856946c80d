"""Tests of recordings: folders and bags open the same way, missing data are named."""

from pathlib import Path

import pytest
from recording_examples import bench_experiment, bench_rig

from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_recording.experiment_folder import write_folder
from porotwin_recording.recording import Recording, open_recording


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_folder(tmp_path / 'experiment', bench_experiment())
    return tmp_path / 'experiment'


def test_missing_data_are_named(folder: Path) -> None:
    (folder / 'concentration.nc').unlink()
    (folder / 'rates.csv').unlink()
    recording = open_recording(folder)
    with pytest.raises(InputError, match='holds no concentration maps'):
        _ = recording.times
    with pytest.raises(InputError, match=r'holds no commanded pump rates; add rates\.csv'):
        _ = recording.schedule


def test_a_given_rig_replaces_the_recorded_one(folder: Path, tmp_path: Path) -> None:
    other = bench_rig().model_copy(update={'porosity': 0.5})
    assert open_recording(folder, rig=other).rig.porosity == 0.5


def test_a_path_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='no such recording'):
        open_recording(tmp_path / 'gone')


def test_measured_rates_replace_commanded_ones_from_the_first_measurement_on() -> None:
    commanded = Schedule.from_rates([(0.0, {'in': WellRate(1e-7)}), (60.0, {'in': WellRate(2e-7)})])
    measured = Schedule((ScheduleRow(30.0, 'in', WellRate(0.9e-7)),))
    recording = Recording(bench_rig(), commanded=commanded, measured=measured, source=Path('run'))
    rows = [(row.time, row.rate.rate) for row in recording.delivered.rows]
    assert rows == [(0.0, 1e-7), (30.0, 0.9e-7)]


def test_without_measurements_the_commanded_rates_count_as_delivered() -> None:
    commanded = Schedule.constant({'in': WellRate(1e-7)})
    for measured in (None, Schedule()):
        recording = Recording(
            bench_rig(), commanded=commanded, measured=measured, source=Path('run')
        )
        assert recording.delivered == commanded


def test_the_rig_file_of_a_folder_means_the_folder(tmp_path: Path) -> None:
    write_folder(tmp_path / 'monday', bench_experiment())
    assert open_recording(tmp_path / 'monday' / 'rig.yaml').source == tmp_path / 'monday'
