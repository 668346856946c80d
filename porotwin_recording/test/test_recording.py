"""Tests of recordings: folders and bags open the same way, missing data are named."""

from pathlib import Path

import pytest
from recording_examples import bench_experiment, bench_rig, controlled_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate, net_rate
from porotwin_recording.experiment.bag_conversion import import_experiment
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import Recording, open_recording


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


def without_maps(folder: Path, **data) -> str:
    """Return the line about missing maps."""
    with pytest.raises(InputError) as refused:
        _ = Recording(bench_rig(), source=folder, **data).present_maps
    return str(refused.value)


def test_photographs_become_maps_in_the_file_that_is_read(folder: Path) -> None:
    (folder / 'concentration.nc').unlink()
    line = without_maps(folder, photos=bench_experiment().photos)
    expected = f'make them with ./porotwin image {folder} --output {folder}/concentration.nc'
    assert line.endswith(expected)


def test_maps_under_another_name_are_named(folder: Path) -> None:
    (folder / 'concentration.nc').rename(folder / 'tracer.nc')
    (folder / 'depth.nc').write_bytes(b'no maps')
    line = without_maps(folder, photos=bench_experiment().photos)
    assert 'if tracer.nc holds them, name it concentration.nc, or make them with' in line
    assert without_maps(folder).endswith('if tracer.nc holds them, name it concentration.nc')


def test_without_photographs_the_place_of_maps_is_told(folder: Path) -> None:
    (folder / 'concentration.nc').unlink()
    assert without_maps(folder).endswith(f'write them as {folder / "concentration.nc"}')


def test_a_bag_without_maps_becomes_a_folder_first() -> None:
    line = without_maps(Path('run.mcap'))
    assert './porotwin export run.mcap FOLDER' in line
    assert './porotwin image FOLDER --output FOLDER/concentration.nc' in line


@pytest.mark.parametrize('as_bag', [False, True])
def test_a_given_rig_replaces_the_recorded_one_with_a_line(
    folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, *, as_bag: bool
) -> None:
    source = folder
    if as_bag:
        source = tmp_path / 'bag'
        import_experiment(folder, source)
    assert open_recording(source, rig=bench_rig()).rig == bench_rig()
    assert not [line for line in caplog.messages if 'another rig.yaml' in line]
    other = bench_rig().model_copy(update={'porosity': 0.5})
    assert open_recording(source, rig=other).rig.porosity == 0.5
    assert caplog.messages[-1] == (
        f'{source}: read with another rig.yaml, which differs in porosity'
    )


def test_a_rig_replaces_a_description_that_cannot_be_read(folder: Path) -> None:
    (folder / 'rig.yaml').write_text('width_m: [')
    assert open_recording(folder, rig=bench_rig()).rig == bench_rig()


def test_a_path_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='no such recording'):
        open_recording(tmp_path / 'gone')


def test_measured_rates_replace_commanded_ones_from_the_first_measurement_on() -> None:
    commanded = Schedule.from_rates([(0.0, {'in': WellRate(1e-7)}), (60.0, {'in': WellRate(2e-7)})])
    rows = [ScheduleRow(time, 'in', WellRate(0.9e-7)) for time in (30.0, 90.0)]
    measured = Schedule(tuple(rows))
    recording = Recording(bench_rig(), commanded=commanded, measured=measured, source=Path('run'))
    found = [(row.time, row.rate.rate) for row in recording.delivered.rows]
    assert found == [(0.0, 1e-7), (30.0, 0.9e-7), (90.0, 0.9e-7)]


def test_wells_without_a_measurement_and_times_after_the_last_one_follow_the_commands() -> None:
    def rows(*given: tuple[float, str, float]) -> Schedule:
        return Schedule(tuple(ScheduleRow(t, well, WellRate(rate)) for t, well, rate in given))

    commanded = rows((0.0, 'in', 1e-7), (0.0, 'out', -2e-7), (50.0, 'in', 3e-7), (90.0, 'in', 0.0))
    measured = rows((10.0, 'in', 0.9e-7), (60.0, 'in', 0.8e-7))
    recording = Recording(bench_rig(), commanded=commanded, measured=measured, source=Path('run'))
    found = [(row.time, row.well, row.rate.rate) for row in recording.delivered.rows]
    assert sorted(found) == [
        (0.0, 'in', 1e-7),
        (0.0, 'out', -2e-7),
        (10.0, 'in', 0.9e-7),
        (60.0, 'in', 0.8e-7),
        (90.0, 'in', 0.0),
    ]


def test_a_command_at_the_last_measured_time_counts_for_wells_without_a_row_there() -> None:
    off, on = WellRate(), WellRate(1e-7)
    commanded = Schedule.from_rates([(0.0, {'in': on, 'out': off}), (60.0, {'in': off, 'out': on})])
    measured = Schedule(
        (*Schedule.constant({'in': on, 'out': off}).rows, ScheduleRow(60, 'in', on))
    )
    recording = Recording(bench_rig(), commanded=commanded, measured=measured, source=Path('run'))
    assert recording.delivered.at(60.0) == {'in': on, 'out': on}


def test_measured_rates_balance_in_a_closed_rig() -> None:
    closed = controlled_rig().model_copy(update={'boundaries': bench_rig().boundaries})
    assert closed.closed and closed.control is not None
    producer = closed.control.producer
    rates = {'in': WellRate(1e-7, 1.0), producer: WellRate(-0.97e-7)}
    recording = Recording(closed, measured=Schedule.constant(rates), source=Path('run'))
    assert net_rate(recording.delivered.at(0.0)) == 0.0
    assert recording.delivered.at(0.0)['in'] == rates['in']


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
