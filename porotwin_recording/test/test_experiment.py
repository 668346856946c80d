"""Experiment folders: what is written comes back, and what is wrong is named."""

from pathlib import Path

import netCDF4
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.errors import InputError
from porotwin_core.rig import Boundaries, Camera, Rig, Well, load_rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_recording.concentration import ConcentrationMaps, ConcentrationWriter, open_maps
from porotwin_recording.experiment import read_experiment, write_experiment
from porotwin_recording.photos import Photo, read_photos
from porotwin_recording.rates import read_rates, write_rates
from porotwin_recording.recording import open_recording

SHARED = Path(__file__).resolve().parents[2].parent / 'shared'
needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason='the shared recordings are not beside the checkout'
)


def make_rig() -> Rig:
    return Rig(
        name='bench',
        width_m=0.4,
        height_m=0.3,
        depth_m=0.01,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1e-3,
        density_kg_m3=998.0,
        boundaries=Boundaries(top='closed'),
        wells={'in': Well(x_m=0.1, z_m=0.1), 'out': Well(x_m=0.3, z_m=0.2)},
        camera=Camera(corners_px=((1, 2), (1, 90), (120, 91), (121, 2))),
    )


def make_maps(rig: Rig, frames: int = 5) -> ConcentrationMaps:
    grid = rig.grid(8, 6)
    generator = np.random.default_rng(731)
    values = generator.random((frames, *grid.shape), dtype=np.float32)
    values[1, 2:4, 3] = np.nan
    return ConcentrationMaps(np.arange(frames) * 30.1, grid, lambda start, stop: values[start:stop])


SCHEDULE = Schedule(
    (
        ScheduleRow(0.0, 'in', WellRate(from_ml_h(523.2), 1.0)),
        ScheduleRow(0.0, 'out', WellRate(from_ml_h(-463.2))),
        ScheduleRow(61.7, 'in', WellRate(0.0, 1.0)),
    )
)


def make_photos() -> tuple[Photo, ...]:
    return (
        Photo(-30.0, 'baseline', 'photos/first.jpg', lambda: b'\xff\xd8 baseline'),
        Photo(0.1 + 0.2, 'state', 'photos/second.jpg', lambda: b'\xff\xd8 state \x00\n'),
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rig = make_rig()
    path = tmp_path / 'experiment'
    write_experiment(path, rig=rig, told=SCHEDULE, maps=make_maps(rig), photos=make_photos())
    return path


def test_experiment_comes_back_bit_for_bit(folder: Path) -> None:
    experiment = read_experiment(folder)
    assert experiment.rig == make_rig()
    assert experiment.told == SCHEDULE
    maps = make_maps(make_rig())
    assert experiment.maps is not None
    assert experiment.maps.times.tobytes() == maps.times.tobytes()
    assert experiment.maps.grid == maps.grid
    assert np.asarray(experiment.maps).tobytes() == maps[:].tobytes()
    for photo, original in zip(experiment.photos, make_photos(), strict=True):
        assert (photo.time, photo.role, photo.name) == (
            original.time,
            original.role,
            original.name,
        )
        assert photo.read() == original.read()


def test_packed_maps_come_back_within_half_a_step(tmp_path: Path) -> None:
    rig = make_rig()
    maps = make_maps(rig)
    path = tmp_path / 'concentration.nc'
    with ConcentrationWriter(path, maps.grid, packed=True) as writer:
        for time, frame in zip(maps.times, maps, strict=True):
            writer.append(time, frame)
    with netCDF4.Dataset(path) as dataset:
        dataset.set_auto_maskandscale(False)
        assert dataset['concentration'].dtype == np.uint8
    # half a step of 0.004, plus the float32 round-off of a value near 1
    np.testing.assert_allclose(open_maps(path, rig)[:], maps[:], rtol=0, atol=0.002 + 1e-6)


def test_maps_are_read_by_index_slice_and_iteration_alike(folder: Path) -> None:
    maps = read_experiment(folder).maps
    assert maps is not None
    whole = maps[:]
    np.testing.assert_array_equal(maps[-1], whole[-1])
    np.testing.assert_array_equal(maps[1:4:2], whole[1:4:2])
    np.testing.assert_array_equal(maps[::-1], whole[::-1])
    np.testing.assert_array_equal(list(maps), whole)
    with pytest.raises(IndexError):
        maps[5]


def test_a_failing_writer_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / 'concentration.nc'
    rig = make_rig()
    with (
        pytest.raises(InputError, match='times must increase'),
        ConcentrationWriter(path, rig.grid(2, 2)) as writer,
    ):
        writer.append(3.0, np.zeros((2, 2)))
        writer.append(3.0, np.zeros((2, 2)))
    assert list(tmp_path.iterdir()) == []


@given(
    rates_ml_h=st.lists(st.floats(-2500, 2500), min_size=1, max_size=5),
    times=st.floats(0, 1e6),
)
def test_any_rate_in_ml_h_comes_back_exactly(
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


@given(rate=st.floats(1e-12, 1e-5))
def test_any_rate_in_si_comes_back_within_its_last_digit(
    tmp_path_factory: pytest.TempPathFactory, rate: float
) -> None:
    path = tmp_path_factory.getbasetemp() / 'rates_si.csv'
    write_rates(path, Schedule.constant({'in': WellRate(rate)}))
    back = read_rates(path, ['in']).at(0)['in'].rate
    assert abs(back - rate) <= np.spacing(rate)


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        ('time,well,rate,c\n', "first line is 'time,well,rate,c'; write time_s"),
        ('', "first line is ''"),
        ('time_s,well,rate_ml_h,concentration\n0,inn,1,0\n', ":2: unknown well 'inn'; .* in, out"),
        ('time_s,well,rate_ml_h,concentration\n-1,in,1,0\n', ':2: time_s -1 is negative'),
        ('time_s,well,rate_ml_h,concentration\n5,in,1,0\n1,in,2,0\n', ':3: .*sort the rows'),
        ('time_s,well,rate_ml_h,concentration\n0,in,nan,0\n', ":2: rate_ml_h is 'nan'"),
        ('time_s,well,rate_ml_h,concentration\n0,in,x,0\n', ":2: rate_ml_h is 'x'"),
        ('time_s,well,rate_ml_h,concentration\n0,in,1,\n', ':2: .*concentration is empty'),
        ('time_s,well,rate_ml_h,concentration\n0,in,1,2\n', ':2: concentration 2; must lie'),
        ('time_s,well,rate_ml_h,concentration\n0,in,1\n', ':2: has 3 values'),
        ('time_s,well,rate_ml_h,concentration\n\n0,"in,1\n', ':3: has 2 values|not readable'),
    ],
)
def test_wrong_rates_are_named(folder: Path, content: str, complaint: str) -> None:
    (folder / 'rates.csv').write_text(content)
    with pytest.raises(InputError, match=complaint) as caught:
        read_experiment(folder)
    assert '\n' not in str(caught.value)
    assert str(folder / 'rates.csv') in str(caught.value)


def test_rates_of_a_spreadsheet_are_read(folder: Path) -> None:
    text = '\ufefftime_s,well,rate_ml_h,concentration\r\n0, out ,-10,\r\n\r\n1e1,in,5,1\r\n'
    (folder / 'rates.csv').write_text(text, newline='')
    told = read_experiment(folder).told
    assert told is not None
    assert told.at(11) == {'out': WellRate(from_ml_h(-10)), 'in': WellRate(from_ml_h(5), 1.0)}


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        ('time,path,role\n', 'write time_s,path,role'),
        ('time_s,path,role\n0,photos/first.jpg,dark\n', ":2: role is 'dark'; write baseline or"),
        ('time_s,path,role\n0,photos/gone.jpg,state\n', "'photos/gone.jpg' is not there"),
        ('time_s,path,role\n0,../first.jpg,state\n', 'leaves the folder'),
        ('time_s,path,role\n,photos/first.jpg,state\n', "time_s is ''"),
    ],
)
def test_wrong_imaging_tables_are_named(folder: Path, content: str, complaint: str) -> None:
    (folder / 'imaging.csv').write_text(content)
    with pytest.raises(InputError, match=complaint):
        read_photos(folder)


def change_maps(folder: Path, name: str, values: object) -> None:
    with netCDF4.Dataset(folder / 'concentration.nc', 'a') as dataset:
        dataset[name][:] = values


def test_maps_of_another_rig_are_named(folder: Path) -> None:
    change_maps(folder, 'x', (np.arange(8) + 0.5) * 0.1)
    with pytest.raises(InputError, match=r'x runs from 0.05 to 0.75 m in 8 cells.*width_m 0.4'):
        read_experiment(folder)


def test_maps_with_z_downward_are_named(folder: Path) -> None:
    change_maps(folder, 'z', ((np.arange(6) + 0.5) * 0.05)[::-1])
    with pytest.raises(InputError, match=r'z runs from 0.275 to 0.025 m'):
        read_experiment(folder)


def test_maps_out_of_order_are_named(folder: Path) -> None:
    change_maps(folder, 'time', [0, 30, 30, 60, 90])
    with pytest.raises(InputError, match='time 30 of frame 2 does not come after 30'):
        read_experiment(folder)


def test_maps_without_times_are_named(folder: Path) -> None:
    change_maps(folder, 'time', np.nan)
    with pytest.raises(InputError, match='time holds values that are not finite'):
        read_experiment(folder)


def test_a_truncated_map_file_is_named(folder: Path) -> None:
    path = folder / 'concentration.nc'
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(InputError, match=r'concentration.nc: not a readable NetCDF file'):
        read_experiment(folder)


def test_a_map_file_without_concentration_is_named(folder: Path) -> None:
    with netCDF4.Dataset(folder / 'concentration.nc', 'w') as dataset:
        dataset.createDimension('time', 1)
    with pytest.raises(InputError, match="has no variable 'concentration'"):
        read_experiment(folder)


def test_photos_without_times_are_named(folder: Path) -> None:
    (folder / 'imaging.csv').unlink()
    with pytest.raises(InputError, match=r'photos/ but no imaging.csv'):
        read_experiment(folder)


def test_a_folder_of_something_else_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='not an experiment folder'):
        read_experiment(tmp_path, make_rig())
    with pytest.raises(InputError, match=r'rig.yaml: no such file'):
        read_experiment(tmp_path)
    with pytest.raises(InputError, match='no such recording'):
        open_recording(tmp_path / 'gone')


def test_writing_over_an_experiment_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match='holds an experiment already'):
        write_experiment(folder, rig=make_rig())


def test_a_recording_insists_on_what_it_lacks(folder: Path) -> None:
    (folder / 'concentration.nc').unlink()
    (folder / 'rates.csv').unlink()
    recording = open_recording(folder)
    with pytest.raises(InputError, match='holds no concentration maps'):
        _ = recording.times
    with pytest.raises(InputError, match='does not say what the pumps were told'):
        _ = recording.schedule


def test_another_rig_takes_the_place_of_the_recorded_one(folder: Path, tmp_path: Path) -> None:
    other = make_rig().model_copy(update={'porosity': 0.5})
    assert open_recording(folder, rig=other).rig.porosity == 0.5


@needs_shared
def test_every_shared_recording_survives_a_copy(tmp_path: Path) -> None:
    for case in ('case_001', 'case_014'):
        original = open_recording(SHARED / 'cases' / case)
        copy = tmp_path / case
        write_experiment(
            copy,
            rig=original.rig,
            told=original.schedule,
            maps=original.maps,
            photos=original.photos,
        )
        back = open_recording(copy)
        assert back.rig == original.rig
        for quantity in ('depth_m', 'permeability_m2'):
            np.testing.assert_array_equal(
                back.rig.nominal_map(quantity), original.rig.nominal_map(quantity)
            )
        assert back.schedule == original.schedule
        assert (copy / 'rates.csv').read_text() == (
            SHARED / 'cases' / case / 'rates.csv'
        ).read_text()
        assert back.times.tobytes() == original.times.tobytes()
        assert back.concentration.tobytes() == original.concentration.tobytes()


@needs_shared
def test_the_real_photographs_are_an_experiment() -> None:
    recording = open_recording(SHARED / 'data' / 'fluidflower_tracer')
    assert [photo.role for photo in recording.photos] == ['baseline', 'state', 'state', 'state']
    assert recording.photos[0].read()[:2] == b'\xff\xd8'
    assert load_rig(SHARED / 'data' / 'fluidflower_tracer').wells.keys() == {'upper', 'lower'}
