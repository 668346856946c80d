"""Tests of the conversion: folder to bag and back, no map, rate or photograph is changed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_examples import SHARED, controlled_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import write_rig
from porotwin_recording.experiment.bag_conversion import export_bag, import_experiment
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.tables.concentration import (
    ConcentrationMaps,
    ConcentrationWriter,
    MapOrigin,
    MapSeries,
)
from porotwin_recording.tables.observations import write_readings
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData


def without_repetitions(schedule: Schedule | None) -> Schedule | None:
    """Return the schedule without rows that do not change a rate."""
    if schedule is None:
        return None
    rates: dict[str, WellRate] = {}
    kept = []
    for row in schedule.rows:
        if rates.get(row.well) != row.rate:
            kept.append(row)
            rates[row.well] = row.rate
    return Schedule(tuple(kept))


def assert_same(back: Recording, original: Recording) -> None:
    assert back.rig.model_dump(exclude={'depth_m', 'porosity', 'permeability_m2'}) == (
        original.rig.model_dump(exclude={'depth_m', 'porosity', 'permeability_m2'})
    )
    for quantity in ('depth_m', 'porosity', 'permeability_m2'):
        np.testing.assert_array_equal(
            back.rig.nominal_map(quantity), original.rig.nominal_map(quantity)
        )
    assert without_repetitions(back.commanded) == without_repetitions(original.commanded)
    assert without_repetitions(back.measured) == without_repetitions(original.measured)
    assert (back.maps is None) == (original.maps is None)
    if original.maps is not None:
        assert back.grid == original.grid
        assert back.times.tobytes() == original.times.tobytes()
        assert back.concentration.tobytes() == original.concentration.tobytes()
        np.testing.assert_array_equal(list(back.maps), original.concentration)
        assert back.maps.origin == original.maps.origin
        for name in ('deviation', 'systematic'):
            series, expected = getattr(back.maps, name), getattr(original.maps, name)
            assert (series is None) == (expected is None)
            if expected is not None:
                assert series[:].tobytes() == expected[:].tobytes()
    assert [(photo.time, photo.role, photo.read()) for photo in back.photos] == [
        (photo.time, photo.role, photo.read()) for photo in original.photos
    ]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rig = controlled_rig()
    grid = rig.grid(8, 6)
    frames = np.random.default_rng(731).random((40, *grid.shape), dtype=np.float32)
    frames[3, :2] = np.nan
    commanded = Schedule(
        (
            ScheduleRow(0.0, 'in', WellRate(from_ml_h(523.2), 1.0)),
            ScheduleRow(0.0, 'out', WellRate(from_ml_h(-463.2))),
            ScheduleRow(61.7, 'water', WellRate(from_ml_h(0.1), 0.0)),
            ScheduleRow(61.7, 'in', WellRate(0.0, 1.0)),
        )
    )
    measured = Schedule((ScheduleRow(0.0, 'out', WellRate(-1.2868055555e-07)),))
    data = RecordedData(
        rig,
        commanded=commanded,
        measured=measured,
        maps=ConcentrationMaps(
            np.round(np.arange(40) * 0.7 + 1 / 3, 9), grid, lambda start, stop: frames[start:stop]
        ),
        photos=(
            Photo(-30.0, 'baseline', 'photos/a.jpg', lambda: b'\xff\xd8 one'),
            Photo(-30.0, 'baseline', 'photos/b.jpg', lambda: b'\xff\xd8 two'),
            Photo(0.3, 'state', 'photos/c.png', lambda: b'\x89PNG\x00 three'),
        ),
    )
    write_folder(tmp_path / 'experiment', data)
    return tmp_path / 'experiment'


@pytest.mark.parametrize('name', ['run', 'run.mcap'])
def test_an_experiment_survives_the_way_through_a_bag(
    folder: Path, tmp_path: Path, name: str
) -> None:
    original = open_recording(folder)
    import_experiment(folder, tmp_path / name)
    assert_same(open_recording(tmp_path / name), original)
    export_bag(tmp_path / name, tmp_path / 'back')
    assert_same(open_recording(tmp_path / 'back'), original)
    assert {path.suffix for path in (tmp_path / 'back' / 'photos').iterdir()} == {'.jpg', '.png'}


def test_deviations_and_the_origin_of_maps_survive_the_way_through_a_bag(
    folder: Path, tmp_path: Path
) -> None:
    plain = open_recording(folder)
    assert plain.maps is not None
    assert plain.maps.deviation is None
    values = np.random.default_rng(4).random((2, 40, *plain.grid.shape), dtype=np.float32)
    values[:, 3, :2] = np.nan
    deviation, systematic = (
        MapSeries(plain.times, plain.grid, lambda a, b, i=i: values[i, a:b]) for i in range(2)
    )
    origin = MapOrigin(calibrated=False, calibration='ab' * 32, program='Others 2.1')
    maps = replace(plain.maps, deviation=deviation, systematic=systematic, origin=origin)
    write_folder(tmp_path / 'imaged', RecordedData(plain.rig, maps=maps))
    original = open_recording(tmp_path / 'imaged')
    assert original.maps is not None
    assert original.maps.origin == origin
    import_experiment(tmp_path / 'imaged', tmp_path / 'run.mcap')
    assert_same(open_recording(tmp_path / 'run.mcap'), original)
    export_bag(tmp_path / 'run.mcap', tmp_path / 'again')
    assert_same(open_recording(tmp_path / 'again'), original)


def test_readings_stay_beside_the_bag(
    folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rig = open_recording(folder).rig
    read = GaugeReading(5.0, GaugeKind.OUTFLOW, -1e-6, 1e-7, next(iter(rig.wells)))
    write_readings(folder / 'observations.csv', [read])
    assert open_recording(folder).readings == (read,)
    import_experiment(folder, tmp_path / 'bag.mcap')
    assert any('observations.csv' in line for line in caplog.messages)
    assert open_recording(tmp_path / 'bag.mcap').readings == ()


def test_importing_twice_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    for name in ('one.mcap', 'two.mcap'):
        import_experiment(folder, tmp_path / name)
    assert (tmp_path / 'one.mcap').read_bytes() == (tmp_path / 'two.mcap').read_bytes()


def test_progress_counts_every_map_and_photograph(folder: Path, tmp_path: Path) -> None:
    for convert, source, target in (
        (import_experiment, folder, tmp_path / 'run'),
        (export_bag, tmp_path / 'run', tmp_path / 'back'),
    ):
        steps: list[tuple[int, int]] = []
        convert(source, target, progress=lambda *step, steps=steps: steps.append(step))
        assert steps[-1] == (43, 43)
        assert [done for done, _ in steps] == sorted(done for done, _ in steps)


@pytest.mark.parametrize('name', ['run', 'run.mcap'])
def test_an_import_that_fails_leaves_nothing(folder: Path, tmp_path: Path, name: str) -> None:
    photo = folder / 'photos' / 'c.png'
    content = photo.read_bytes()

    def lose_the_photograph(*_: int) -> None:
        photo.unlink(missing_ok=True)

    with pytest.raises(FileNotFoundError):
        import_experiment(folder, tmp_path / name, progress=lose_the_photograph)
    assert [path.name for path in tmp_path.iterdir()] == ['experiment']
    photo.write_bytes(content)
    import_experiment(folder, tmp_path / name)
    assert_same(open_recording(tmp_path / name), open_recording(folder))


def test_maps_from_before_time_zero_keep_their_times(folder: Path, tmp_path: Path) -> None:
    data = open_recording(folder)
    times = np.round(data.times - 60.0, 9)
    early = replace(data, maps=replace(data.present_maps, times=times), photos=())
    write_folder(tmp_path / 'early', early)
    import_experiment(tmp_path / 'early', tmp_path / 'run')
    assert_same(open_recording(tmp_path / 'run'), open_recording(tmp_path / 'early'))


@pytest.mark.parametrize('same', [True, False])
def test_an_interrupted_export_goes_on(folder: Path, tmp_path: Path, same: bool) -> None:
    import_experiment(folder, tmp_path / 'run')
    if not same:  # another recording of the name began
        (tmp_path / '.back.partial').mkdir()
        (tmp_path / '.back.partial' / 'other.png').touch()
    steps = []

    def stop(done: int, total: int) -> None:
        steps.append(done)
        if done == total - 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_bag(tmp_path / 'run', tmp_path / 'back', progress=stop)
    assert not (tmp_path / 'back').exists()
    kept = sorted((tmp_path / '.back.partial' / 'photos').iterdir())
    times = [path.stat().st_mtime_ns for path in kept]
    export_bag(tmp_path / 'run', tmp_path / 'back')
    back = tmp_path / 'back' / 'photos'
    assert [(back / path.name).stat().st_mtime_ns for path in kept] == times
    assert_same(open_recording(tmp_path / 'back'), open_recording(folder))
    assert sorted(path.name for path in tmp_path.iterdir()) == ['back', 'experiment', 'run']


def test_an_export_that_fails_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    import_experiment(folder, tmp_path / 'run')

    def fail(*_: int) -> None:
        raise InputError('the disk is full')

    with pytest.raises(InputError, match='full'):
        export_bag(tmp_path / 'run', tmp_path / 'back', progress=fail)
    assert sorted(path.name for path in tmp_path.iterdir()) == ['experiment', 'run']


def test_nothing_is_overwritten(folder: Path, tmp_path: Path) -> None:
    import_experiment(folder, tmp_path / 'run')
    with pytest.raises(InputError, match='run: exists already'):
        import_experiment(folder, tmp_path / 'run')
    with pytest.raises(InputError, match='experiment: exists already'):
        export_bag(tmp_path / 'run', folder)


def well_rate(rate: float, concentration: float) -> WellRate:
    return WellRate(rate, 0.0 if rate < 0 else concentration)


rates = st.just(0.0) | st.floats(1e-12, 1e-6) | st.floats(-1e-6, -1e-12)
well_rates = st.dictionaries(
    st.sampled_from(['in', 'out', 'water']),
    st.builds(well_rate, rates, st.floats(0, 1)),
    min_size=1,
)


@given(
    changes=st.lists(
        st.tuples(st.integers(0, 9 * 10**15).map(lambda ns: ns / 1e9), well_rates),
        min_size=1,
        max_size=6,
    )
)
@settings(max_examples=20)
def test_any_schedule_survives_the_way_through_a_bag(
    tmp_path_factory: pytest.TempPathFactory, changes: list
) -> None:
    base = tmp_path_factory.mktemp('schedule')
    rows = (
        ScheduleRow(time, well, rate) for time, rates in changes for well, rate in rates.items()
    )
    schedule = Schedule(tuple(rows))
    write_folder(base / 'experiment', RecordedData(controlled_rig(), commanded=schedule))
    original = open_recording(base / 'experiment').schedule
    import_experiment(base / 'experiment', base / 'run.mcap')
    recording = open_recording(base / 'run.mcap')
    for time in {row.time for row in schedule.rows}:
        assert recording.schedule.at(time) == original.at(time)
    assert set(recording.schedule.wells) == set(original.wells)


@pytest.mark.skipif(not SHARED.is_dir(), reason='the shared recordings are not beside the checkout')
@pytest.mark.parametrize('case', ['cases/case_001', 'cases/case_014', 'data/fluidflower_tracer'])
def test_shared_recordings_survive_the_way_through_a_bag(tmp_path: Path, case: str) -> None:
    original = open_recording(SHARED / case)
    import_experiment(SHARED / case, tmp_path / 'run')
    assert_same(open_recording(tmp_path / 'run'), original)
    export_bag(tmp_path / 'run', tmp_path / 'back')
    assert_same(open_recording(tmp_path / 'back'), original)


def test_a_bag_that_is_cut_off_gives_the_first_maps(folder: Path, tmp_path: Path) -> None:
    original = open_recording(folder)
    bag = tmp_path / 'run.mcap'
    complete = tmp_path / 'complete.mcap'
    import_experiment(folder, complete)
    with BagWriter(bag, compress=False) as writer:
        for message in (reader := BagReader(complete)).messages():
            topic = reader.topics[message.topic]
            writer.add_topic(topic.name, topic.type_name, definition=topic.definition)
            writer.write(topic.name, message.data, log_time=message.log_time)
            writer.flush()
    content = bag.read_bytes()
    bag.write_bytes(content[: len(content) // 2])
    recording = open_recording(bag)
    frames = len(recording.times)
    assert 0 < frames < 40
    assert recording.concentration.tobytes() == original.concentration[:frames].tobytes()
    assert 'has no end' in recording.remarks[0]


def test_packed_maps_come_back_as_the_same_values(tmp_path: Path) -> None:
    rig = controlled_rig()
    grid = rig.grid(8, 6)
    (tmp_path / 'packed').mkdir()
    write_rig(rig, tmp_path / 'packed' / 'rig.yaml')
    with ConcentrationWriter(tmp_path / 'packed' / 'concentration.nc', grid, packed=True) as nc:
        nc.append(0.0, np.linspace(0, 1, 48).reshape(grid.shape))
    import_experiment(tmp_path / 'packed', tmp_path / 'run')
    assert_same(open_recording(tmp_path / 'run'), open_recording(tmp_path / 'packed'))


def test_a_rig_of_sands_travels_through_a_bag_and_back(tmp_path: Path) -> None:
    shipped = Path(__file__).resolve().parents[2] / 'rigs' / 'two_sands'
    import_experiment(shipped, tmp_path / 'run.mcap')
    export_bag(tmp_path / 'run.mcap', tmp_path / 'again')
    first, again = (open_recording(path).rig for path in (shipped, tmp_path / 'again'))
    assert again.physics_fingerprint == first.physics_fingerprint
    for quantity in ('porosity', 'permeability_m2'):
        np.testing.assert_array_equal(again.nominal_map(quantity), first.nominal_map(quantity))
