"""Tests of imported maps: npz, CSV, NetCDF and zarr."""

import base64
import io
import re
import struct
import zipfile
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import scipy.io
import tifffile
import zarr
from recording_examples import bench_experiment, bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment import dataset_export
from porotwin_recording.experiment.dataset_export import export_dataset
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.importers.foreign_units import time_factor
from porotwin_recording.importers.map_import import MapAnswers, import_maps

PLAIN = MapAnswers()


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    write_folder(tmp_path / 'origin', bench_experiment())
    return open_recording(tmp_path / 'origin')


def imported(path: Path, answers: MapAnswers = PLAIN) -> tuple[Recording, list[str]]:
    """Return the recording that is made of a file, and what was told."""
    target = path.parent / f'made_of_{path.suffix[1:]}'
    told = import_maps(path, target, bench_rig(), answers)
    return open_recording(target), told


@pytest.mark.parametrize(('kind', 'name'), [('zarr', 'maps.zarr'), ('netcdf', 'maps.nc')])
def test_a_dataset_for_notebooks_is_read_back(
    tmp_path: Path, recording: Recording, kind, name: str
) -> None:
    export_dataset(recording, tmp_path / name, kind)
    found, _ = imported(tmp_path / name)
    np.testing.assert_array_equal(found.concentration, recording.concentration)
    np.testing.assert_allclose(found.times, recording.times)
    if kind == 'zarr':  # one file holds all metadata, and units are texts
        text = (tmp_path / name / '.zmetadata').read_text()
        assert '"units": "1"' in text
        assert 'concentration/.zarray' in text


@pytest.mark.parametrize(('kind', 'name'), [('zarr', 'maps.zarr'), ('netcdf', 'maps.nc')])
def test_an_interrupted_dataset_goes_on(
    tmp_path: Path, kind, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset_export, 'MAPS_AT_ONCE', 2)
    write_folder(tmp_path / 'origin', bench_experiment())
    recording, done = open_recording(tmp_path / 'origin'), []

    def stop(count: int, _: int) -> None:
        done.append(count)
        if len(done) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_dataset(recording, tmp_path / name, kind, progress=stop)
    assert not (tmp_path / name).exists()
    export_dataset(recording, tmp_path / name, kind, progress=stop)
    assert done == [2, 4, *range(6, len(recording.times), 2), len(recording.times)]
    found, _ = imported(tmp_path / name)
    np.testing.assert_array_equal(found.concentration, recording.concentration)
    assert sorted(path.name for path in tmp_path.iterdir() if path.name.startswith('.')) == []


@pytest.mark.parametrize(('kind', 'name'), [('zarr', 'maps.zarr'), ('netcdf', 'maps.nc')])
def test_an_interrupted_dataset_begins_again_with_other_maps(
    tmp_path: Path, kind, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset_export, 'MAPS_AT_ONCE', 2)
    folder, data = tmp_path / 'origin', bench_experiment()
    write_folder(folder, data)

    def stop(done: int, _: int) -> None:
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_dataset(open_recording(folder), tmp_path / name, kind, progress=stop)
    for file in folder.iterdir():
        if file.is_file():
            file.unlink()
    assert data.maps is not None
    read = data.maps.read
    halved = replace(data.maps, read=lambda first, stop: 0.5 * read(first, stop))
    write_folder(folder, replace(data, maps=halved))
    export_dataset(open_recording(folder), tmp_path / name, kind)
    found, _ = imported(tmp_path / name)
    np.testing.assert_array_equal(found.concentration, open_recording(folder).concentration)


def test_npz_in_percent_and_minutes_with_the_first_row_at_the_top(
    tmp_path: Path, recording: Recording
) -> None:
    path = tmp_path / 'maps.npz'
    maps = recording.concentration[:, ::-1]
    np.savez(path, maps=100 * maps, time_min=recording.times / 60.0)
    with pytest.raises(InputError, match='give --first-row top'):
        imported(path)
    with pytest.raises(InputError, match=r'--stock 100'):
        imported(path, MapAnswers(first_row='top'))
    found, told = imported(path, MapAnswers(first_row='top', stock=100.0))
    np.testing.assert_allclose(found.concentration, recording.concentration, rtol=1e-6)
    np.testing.assert_allclose(found.times, recording.times)
    assert f'{path}: times in min' in told
    np.savez(path, maps=maps, t=recording.times)
    with pytest.raises(InputError, match='--time-unit'):
        imported(path, MapAnswers(first_row='top'))


def test_a_long_table_in_any_order_with_decimal_commas(
    tmp_path: Path, recording: Recording
) -> None:
    grid, lines = recording.grid, []
    for time, values in zip(recording.times, recording.concentration, strict=True):
        for row, column in np.argwhere(np.isfinite(values))[::-1]:
            numbers = (time, grid.x[column], grid.z[row], values[row, column])
            lines.append(';'.join(f'{number:.9g}'.replace('.', ',') for number in numbers))
    path = tmp_path / 'maps.csv'
    path.write_text('\n'.join(['time [s];x [m];z [m];concentration', *lines]))
    found, _ = imported(path)
    np.testing.assert_allclose(found.concentration, recording.concentration, rtol=1e-6)


@pytest.mark.parametrize('unknown', ['', 'NaN'])
def test_unknown_values_of_a_table_are_unknown_in_the_maps(tmp_path: Path, unknown: str) -> None:
    """Other programs write a row for every cell, also for one that a photograph does not show."""
    grid = bench_rig().grid(3, 2)
    rows = [
        f'{time},{x},{z},{unknown if column == 0 else 0.5}'
        for time in (0, 30)
        for column, x in enumerate(grid.x)
        for z in grid.z
    ]
    path = tmp_path / 'maps.CSV'
    path.write_text('\n'.join(['time [s],x,z,concentration', *rows]))
    found, told = imported(path)
    np.testing.assert_array_equal(found.concentration[1], [[np.nan, 0.5, 0.5]] * 2)
    assert any('4 of 12 values are read as not known: no number (4)' in line for line in told)
    path.write_text('\n'.join(['time [s],x,z,concentration', *rows[1:]]))
    (tmp_path / 'made_of_CSV').rename(tmp_path / 'other')
    assert any('no line (1)' in line for line in imported(path)[1])


@pytest.mark.parametrize('count', [11, 12, 13])
def test_edges_in_place_of_centres_are_refused_whatever_the_round_off(
    tmp_path: Path, count: int
) -> None:
    rig = bench_rig()
    edges, path = np.linspace(0.0, rig.width_m, count), tmp_path / 'maps.npz'
    np.savez(
        path, maps=np.full((2, 3, count), 0.5), time_s=[0, 30], x=edges, z=rig.grid(count, 3).z
    )
    with pytest.raises(InputError, match='centres of its cells run from'):
        imported(path)


def test_maps_of_another_rig_and_broken_files_are_refused(
    tmp_path: Path, recording: Recording
) -> None:
    times, maps = recording.times, recording.concentration
    x = 2 * recording.grid.x
    np.savez(tmp_path / 'wide.npz', maps=maps, time_s=times, x=x, z=recording.grid.z)
    with pytest.raises(InputError, match=r'but the rig is 0\.4 m'):
        imported(tmp_path / 'wide.npz')
    (tmp_path / 'broken.npz').write_bytes(b'PK')
    (tmp_path / 'new.zarr').mkdir()
    (tmp_path / 'new.zarr' / 'zarr.json').touch()
    for name, reason in (
        ('broken.npz', 'not readable as npz'),
        ('new.zarr', 'not readable as zarr'),
    ):
        with pytest.raises(InputError, match=reason):
            imported(tmp_path / name)


@pytest.mark.parametrize(
    ('change', 'stock', 'fault'),
    [
        (lambda maps: np.where(maps > 0.5, np.inf, maps), None, r'\d+ values .* are infinite'),
        (lambda maps: np.where(maps > 0.5, np.inf, maps), np.inf, '--stock inf: give a finite'),
        (lambda maps: maps, 0.0, '--stock 0: give a finite number above 0'),
        (lambda maps: maps, -1.0, '--stock -1: give'),
        (lambda maps: -maps, None, 'none is above 0; correct their sign'),
        (lambda maps: maps + 1j, None, 'of the type complex.*; write real numbers'),
        (lambda maps: maps.astype(str), None, 'of the type .*; write real numbers'),
    ],
)
def test_values_that_are_no_concentrations_are_refused(
    tmp_path: Path, recording: Recording, change, stock: float | None, fault: str
) -> None:
    maps = np.nan_to_num(recording.concentration)
    np.savez(tmp_path / 'maps.npz', maps=change(maps), time_s=recording.times)
    with pytest.raises(InputError, match=fault):
        imported(tmp_path / 'maps.npz', MapAnswers(first_row='bottom', stock=stock))
    assert not (tmp_path / 'made_of_npz').exists()


@pytest.mark.parametrize('turned', ['x', 'z'])
def test_maps_whose_coordinates_fall_are_turned(
    tmp_path: Path, recording: Recording, turned: str
) -> None:
    columns, rows = (slice(None, None, -1 if turned == name else 1) for name in 'xz')
    np.savez(
        tmp_path / 'maps.npz',
        maps=recording.concentration[:, rows, columns],
        time_s=recording.times,
        x=recording.grid.x[columns],
        z=recording.grid.z[rows],
    )
    found, told = imported(tmp_path / 'maps.npz')
    np.testing.assert_array_equal(found.concentration, recording.concentration)
    assert any('x falls' in line for line in told) == (turned == 'x')


def write_netcdf(
    path: Path, recording: Recording, *, seconds: float, since: str, unit: str = '1'
) -> None:
    """Write the maps with x falling, and times that begin `seconds` later, `since` a date."""
    grid = recording.grid
    with netCDF4.Dataset(path, 'w') as dataset:
        axes = {
            'time': (recording.times + seconds, f's since {since}'),
            'z': (grid.z, 'm'),
            'x': (grid.x[::-1], 'm'),
        }
        for name, (values, own) in axes.items():
            dataset.createDimension(name, len(values))
            dataset.createVariable(name, 'f8', (name,))[:] = values
            dataset[name].units = own
        maps = dataset.createVariable('c', 'f4', ('time', 'z', 'x'), fill_value=np.nan)
        maps.units = unit
        maps[:] = recording.concentration[:, :, ::-1]


@pytest.mark.parametrize('unit', ['g l-1', 'mg/L', '%'])
def test_another_unit_of_concentration_is_not_dropped(
    tmp_path: Path, recording: Recording, unit: str
) -> None:
    path = tmp_path / 'maps.nc'
    write_netcdf(path, recording, seconds=0.0, since='2024-05-01', unit=unit)
    with pytest.raises(InputError, match=f"concentrations are in '{unit.lower()}'.* give --stock"):
        imported(path)
    found, _ = imported(path, MapAnswers(stock=0.5))
    np.testing.assert_allclose(found.concentration, 2 * recording.concentration, rtol=1e-6)


def test_times_since_a_date_keep_it_as_zero_where_the_maps_begin_soon_after(
    tmp_path: Path, recording: Recording
) -> None:
    path = tmp_path / 'maps.nc'
    write_netcdf(path, recording, seconds=0.0, since='2024-05-01')
    found, told = imported(path)
    np.testing.assert_allclose(found.times, recording.times)
    assert f'{path}: time zero is 2024-05-01' in told


@pytest.mark.parametrize('months', [1, 600])
def test_netcdf_with_falling_x_and_times_long_after_a_date(
    tmp_path: Path, recording: Recording, months: int
) -> None:
    late = months * 2_600_000.0
    write_netcdf(tmp_path / 'maps.nc', recording, seconds=late, since='1970-01-01')
    found, told = imported(tmp_path / 'maps.nc')
    np.testing.assert_array_equal(found.concentration, recording.concentration)
    np.testing.assert_allclose(found.times, recording.times - recording.times[0], atol=1e-6)
    zero = f'time zero is the first map, {late + recording.times[0]:.10g} s since 1970-01-01'
    assert any(zero in line for line in told)


@pytest.mark.parametrize('step', [1, -1])
def test_z_that_counts_downward_turns_the_maps(
    tmp_path: Path, recording: Recording, step: int
) -> None:
    path = tmp_path / 'maps.nc'
    write_netcdf(path, recording, seconds=0.0, since='2024-05-01')
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset['z'].positive = 'down'
        dataset['z'][:] = dataset['z'][::step]
        dataset['c'][:] = dataset['c'][:, ::-step]
    found, told = imported(path)
    np.testing.assert_array_equal(found.concentration, recording.concentration)
    assert sum('from the top down (positive: down)' in line for line in told) == 1


def shuffled(values: np.ndarray) -> np.ndarray:
    """Return `values` with the first two exchanged."""
    return values[[1, 0, *range(2, len(values))]]


@pytest.mark.parametrize(
    ('change', 'fault'),
    [
        ({'x': shuffled}, 'x neither rises nor falls'),
        ({'z': shuffled}, 'z neither rises nor falls'),
        ({'x': lambda x: x[::2]}, r'but maps of .*; give a coordinate for every'),
        ({'maps': lambda maps: np.swapaxes(maps, 1, 2)}, 'the maps look transposed'),
        ({'x': lambda x: x * np.nan}, 'x is no row of finite numbers'),
        ({'z': lambda z: z.astype(str)}, 'z is no row of finite numbers'),
        ({'z': lambda z: z[::-1]}, 'z falls, .* at the top, but --first-row says bottom'),
        ({'time_s': lambda t: t + 1.7e9}, r'begin at 1\.7e\+09 s, 53\.9 years .*since 1970'),
        ({'time_s': lambda t: t * 1e9}, r'span .* years; .* --time-unit'),
    ],
)
def test_impossible_coordinates_and_times_are_refused(
    tmp_path: Path, recording: Recording, change, fault: str
) -> None:
    arrays = {
        'maps': recording.concentration,
        'time_s': recording.times,
        'x': recording.grid.x,
        'z': recording.grid.z,
    }
    arrays |= {name: turn(arrays[name]) for name, turn in change.items()}
    np.savez(tmp_path / 'maps.npz', **arrays)
    with pytest.raises(InputError, match=fault):
        imported(tmp_path / 'maps.npz', MapAnswers(first_row='bottom'))
    assert not (tmp_path / 'made_of_npz').exists()


def dates(*words: str) -> np.ndarray:
    """Return five dates: these ones, and minutes after 12:00."""
    rest = [f'2024-05-01T12:0{minute}' for minute in range(5 - len(words))]
    return np.array([*words, *rest], 'datetime64[s]')


@pytest.mark.parametrize(
    ('times', 'fault'),
    [
        (dates('2024-05-01T13:00'), 'do not increase: map 2 is of 2024-05-01T12:00:00, .*13:00:00'),
        (dates('2024-05-01T10:00', 'NaT'), 'the time of map 2 is NaT'),
        (dates(*['NaT'] * 5), 'the time of map 1 is NaT'),
        (dates('1970-01-01'), 'time of map 1, 1970-01-01T00:00:00, is more than a year from'),
        (np.array([0.0, 10.0, 1.7e9, 30.0, 40.0]), 'the time of map 3, 1700000000, is more than'),
        (np.array([0.0, 10.0, 5.0, 30.0, 40.0]), 'map 3 is of 5, the one before it of 10'),
        (np.array(['10:00', '10:01', '10:02', '10:03', '10:04']), 'is no date'),
        (np.zeros((5, 1)), 'no row of numbers'),
    ],
)
def test_times_that_do_not_rise_are_named_with_their_map(
    tmp_path: Path, recording: Recording, times: np.ndarray, fault: str
) -> None:
    path = tmp_path / 'maps.npz'
    np.savez(path, maps=recording.concentration, time_s=times)
    with pytest.raises(InputError, match=f'{path}: .*{fault}') as refusal:
        imported(path, MapAnswers(first_row='bottom'))
    assert '\n' not in str(refusal.value)
    assert not (tmp_path / 'made_of_npz').exists()


def test_transposed_maps_without_coordinates_are_refused(tmp_path: Path) -> None:
    path = tmp_path / 'maps.npz'
    maps = np.random.default_rng(1).random((2, 30, 40))
    answers = MapAnswers(first_row='bottom')
    np.savez(path, maps=np.swapaxes(maps, 1, 2), time_s=[0, 10])
    with pytest.raises(InputError, match='maps of 40 rows and 30 columns look transposed'):
        imported(path, answers)
    for name, shape in (('square', (2, 20, 20)), ('flat', (2, 10, 40)), ('right', (2, 30, 40))):
        path = tmp_path / name / 'maps.npz'
        path.parent.mkdir()
        np.savez(path, maps=np.ones(shape), time_s=[0, 10])
        assert imported(path, answers)[0].concentration.shape == shape


def test_a_quantity_with_two_names_is_asked_for(tmp_path: Path, recording: Recording) -> None:
    path, maps = tmp_path / 'maps.npz', recording.concentration
    answers = MapAnswers(first_row='bottom')
    np.savez(path, c_raw=maps, c_filtered=maps, time_s=recording.times)
    with pytest.raises(InputError, match='which concentration is meant, c_raw or c_filtered'):
        imported(path, answers)
    np.savez(path, c_std=0 * maps, c=maps, time_bnds=np.zeros(5), time=recording.times)
    found, _ = imported(path, MapAnswers('s', first_row='bottom'))
    np.testing.assert_array_equal(found.concentration, maps)


def test_values_far_below_zero_are_told(tmp_path: Path, recording: Recording) -> None:
    maps = np.nan_to_num(recording.concentration)
    maps[0, 0, 0] = -0.8
    np.savez(tmp_path / 'maps.npz', maps=maps, time_s=recording.times)
    _, told = imported(tmp_path / 'maps.npz', MapAnswers(first_row='bottom'))
    assert any('go down to -0.8' in line for line in told)


def test_infinite_values_of_netcdf_are_refused_and_its_gaps_kept(
    tmp_path: Path, recording: Recording
) -> None:
    for name, value, kind in (('gaps', -9.0, 'i2'), ('infinite', np.inf, 'f4')):
        with netCDF4.Dataset(tmp_path / f'{name}.nc', 'w') as dataset:
            for axis, length in zip(('time', 'z', 'x'), recording.concentration.shape, strict=True):
                dataset.createDimension(axis, length)
            dataset.createVariable('time', 'f8', ('time',))[:] = recording.times
            dataset['time'].units = 's'
            maps = dataset.createVariable('c', kind, ('time', 'z', 'x'), fill_value=-9)
            maps[:] = np.where(recording.concentration > 0.5, value, 1.0)
    answers = MapAnswers(first_row='bottom')
    found, _ = imported(tmp_path / 'gaps.nc', answers)
    assert np.array_equal(np.isnan(found.concentration), recording.concentration > 0.5)
    with pytest.raises(InputError, match='are infinite'):
        imported(tmp_path / 'infinite.nc', answers)


def test_two_values_at_one_place_and_a_file_that_is_no_npz_are_named(tmp_path: Path) -> None:
    table = tmp_path / 'maps.csv'
    table.write_text('time [s],x [m],z [m],concentration\n0,0.1,0.2,1\n0,0.1,0.2,0.5\n')
    with pytest.raises(InputError, match=r'2 values at time 0, x 0\.1, z 0\.2; remove all but'):
        imported(table)
    (tmp_path / 'text.npz').write_text('0,1,2')
    with pytest.raises(InputError, match=r'not readable as npz \(no npz\).* numpy\.savez'):
        imported(tmp_path / 'text.npz')
    with (tmp_path / 'one.npz').open('wb') as file:
        np.save(file, np.zeros(3))
    with pytest.raises(InputError, match='not readable as npz'):
        imported(tmp_path / 'one.npz')


def npz_of_header(path: Path, shape: tuple[int, ...]) -> None:
    """Write a npz whose maps claim a shape, without values."""
    with zipfile.ZipFile(path, 'w') as archive:
        for name, claimed in (('maps', shape), ('times', (2,))):
            header = io.BytesIO()
            np.lib.format.write_array_header_1_0(
                header, {'shape': claimed, 'fortran_order': False, 'descr': '<f8'}
            )
            archive.writestr(f'{name}.npy', header.getvalue())


def test_a_file_that_claims_more_than_memory_is_refused_by_its_header(tmp_path: Path) -> None:
    npz_of_header(tmp_path / 'maps.npz', (6000, 1000, 1000))
    with netCDF4.Dataset(tmp_path / 'maps.nc', 'w') as dataset:
        for name, size in (('time', 1200), ('z', 1000), ('x', 1000)):
            dataset.createDimension(name, size)
            dataset.createVariable(name, 'f8', (name,))
        maps = dataset.createVariable(
            'concentration', 'f8', ('time', 'z', 'x'), zlib=True, chunksizes=(1, 1000, 1000)
        )
        maps[0] = 0.0
    lines = ['time [s],x [m],z [m],c', *(f'{n},{n},{n},0.1' for n in range(2000))]
    (tmp_path / 'maps.csv').write_text('\n'.join(lines))
    for name in ('maps.npz', 'maps.nc', 'maps.csv'):
        assert (tmp_path / name).stat().st_size < 200_000
        with pytest.raises(InputError, match='claims'):
            import_maps(tmp_path / name, tmp_path / 'made', bench_rig(), PLAIN)


def bench_maps(recording: Recording) -> dict[str, np.ndarray]:
    """Return the arrays of a recording as other programs would write them."""
    maps, grid = np.nan_to_num(recording.concentration), recording.grid
    return {'concentration': maps, 'time_s': recording.times, 'x': grid.x, 'z': grid.z}


@pytest.mark.parametrize('version', [2, 3])
def test_zarr_of_both_versions_is_read_with_its_fill_value(tmp_path, recording, version) -> None:
    arrays = bench_maps(recording)
    arrays['concentration'][1, 2, 3] = -7.0
    group = zarr.open_group(tmp_path / 'maps.zarr', mode='w', zarr_format=version)
    for name, dimensions in (
        ('concentration', ['time_s', 'z', 'x']),
        *((name, [name]) for name in ('time_s', 'x', 'z')),
    ):
        values, known = arrays[name], {} if version == 3 else {'_ARRAY_DIMENSIONS': dimensions}
        array = group.create_array(
            name,
            shape=values.shape,
            dtype=values.dtype,
            dimension_names=dimensions if version == 3 else None,
            attributes={**known, 'units': {'time_s': 's'}.get(name, '1' if len(name) > 1 else 'm')},
        )
        if name == 'concentration':
            fill = base64.b64encode(struct.pack('<d', -7.0)).decode()  # as xarray does
            array.attrs['_FillValue'] = fill if version == 3 else -7.0
        array[...] = values
    found, told = imported(tmp_path / 'maps.zarr')
    assert np.isnan(found.concentration[1, 2, 3])
    assert np.isnan(found.concentration).sum() == 1
    assert any('-7 (_FillValue) (1)' in line for line in told)


@pytest.mark.parametrize('axis', [0, -1])
def test_matlab_files_are_read_row_column_time_or_time_first(
    tmp_path: Path, recording: Recording, axis: int
) -> None:
    arrays = bench_maps(recording)
    wide, high = np.meshgrid(arrays['x'], arrays['z'])
    turned = np.moveaxis(arrays['concentration'], 0, axis)
    known = {'C': turned, 't_min': arrays['time_s'] / 60, 'X': wide, 'Z': high}
    scipy.io.savemat(tmp_path / 'maps.mat', known)
    found, _ = imported(tmp_path / 'maps.mat')
    np.testing.assert_allclose(found.concentration, arrays['concentration'])
    np.testing.assert_allclose(found.times, recording.times)


def test_tiff_stacks_have_the_times_of_imagej(tmp_path: Path, recording: Recording) -> None:
    maps = bench_maps(recording)['concentration'].astype(np.float32)
    about = {'axes': 'TYX', 'finterval': 0.5, 'tunit': 'min'}
    tifffile.imwrite(tmp_path / 'maps.tif', maps[:, ::-1], imagej=True, metadata=about)
    found, _ = imported(tmp_path / 'maps.tif', MapAnswers(first_row='top'))
    np.testing.assert_array_equal(found.concentration, maps)
    np.testing.assert_allclose(found.times, 30.0 * np.arange(len(maps)))
    tifffile.imwrite(tmp_path / 'other.tif', maps)
    with pytest.raises(InputError, match=r'holds no times; set the frame interval in ImageJ'):
        imported(tmp_path / 'other.tif')


@pytest.mark.parametrize(
    ('unit', 'calendar', 'factor'),
    [
        ('milliseconds since 2024-05-31 14:30:00', 'standard', 1e3),
        ('microseconds since 2024-05-31', 'proleptic_gregorian', 1e6),
        ('hours since 2024-05-31', 'noleap', 1 / 3600),
        ('days since 2024-05-31', 'julian', 1 / 86400),
        ('months since 2024-05-30', '360_day', 1 / (30 * 86400)),
        ('months since 2024-05-31', 'standard', None),
    ],
)
def test_times_of_cf_are_read(tmp_path, recording, unit, calendar, factor) -> None:
    arrays = bench_maps(recording)
    with netCDF4.Dataset(tmp_path / 'maps.nc', 'w') as dataset:
        for name, key in (('time', 'time_s'), ('z', 'z'), ('x', 'x')):
            dataset.createDimension(name, len(arrays[key]))
            scale = (factor or 1.0) if name == 'time' else 1.0
            dataset.createVariable(name, 'f8', (name,))[:] = arrays[key] * scale
        dataset['time'].setncatts({'units': unit, 'calendar': calendar})
        dataset.createVariable('dye', 'f4', ('time', 'z', 'x'))[:] = arrays['concentration']
    if factor is None:
        with pytest.raises(InputError, match="'months' is no unit of time with one length"):
            imported(tmp_path / 'maps.nc')
    else:
        np.testing.assert_allclose(imported(tmp_path / 'maps.nc')[0].times, recording.times)


def test_a_number_that_stands_far_above_all_others_is_asked_for(tmp_path, recording) -> None:
    arrays = bench_maps(recording)
    arrays['concentration'][0, :2, :2] = 999
    np.savez(tmp_path / 'maps.npz', **arrays)
    with pytest.raises(InputError, match=r'--stock 999 \(.*, or --no-value 999 \('):
        imported(tmp_path / 'maps.npz')
    found, told = imported(tmp_path / 'maps.npz', MapAnswers(no_value=999.0))
    assert np.isnan(found.concentration).sum() == 4
    assert any('999 (--no-value) (4)' in line for line in told)


def test_a_file_of_maps_and_a_recording_read_the_same_values(tmp_path, recording) -> None:
    path = tmp_path / 'origin' / 'concentration.nc'
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset['concentration'].valid_max = np.float32(0.5)
        dataset['concentration'][0, 0, 0] = -9999
    opened = open_recording(tmp_path / 'origin').concentration
    path.rename(tmp_path / 'maps.nc')
    np.testing.assert_array_equal(imported(tmp_path / 'maps.nc')[0].concentration, opened)
    assert np.nanmax(opened) <= 0.5


@pytest.mark.parametrize(('unit', 'seconds'), [('weeks', 604800.0), ('fortnights', 1209600.0)])
def test_units_of_time_with_one_length_are_read(unit: str, seconds: float) -> None:
    assert time_factor(unit, 'maps.nc: time') == pytest.approx(seconds)


def test_times_as_text_in_a_group_in_percent_are_read(tmp_path: Path) -> None:
    rig = bench_rig()
    with netCDF4.Dataset(tmp_path / 'maps.nc', 'w') as file:
        group = file.createGroup('run')
        for name, size in (('time', 2), ('z', 4), ('x', 6)):
            group.createDimension(name, size)
        group.createVariable('time', str, ('time',))[:] = np.array(
            ['2024-05-31T14:30:00', '2024-05-31T14:35:00'], dtype=object
        )
        maps = group.createVariable('concentration', 'f4', ('time', 'z', 'x'))
        maps.units = '%'
        maps[:] = np.linspace(0.0, 100.0, 48).reshape(2, 4, 6)
        z = group.createVariable('z', 'f8', ('z',))
        z[:] = rig.height_m * (np.arange(4) + 0.5) / 4
    import_maps(tmp_path / 'maps.nc', tmp_path / 'made', rig, MapAnswers())
    made = open_recording(tmp_path / 'made').present_maps
    assert made.times.tolist() == [0.0, 300.0]
    assert made[:].max() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('times', 'fault'),
    [
        (['45443.1', '45443.2'], 'counts from a date'),
        (['3/4/2024 10:00', '3/4/2024 11:00'], 'day and month, or month and day?'),
        ([b'31 M\xe4rz 2024', b'1 April 2024'], 'the time of map 1'),
        (np.array([1, 2], 'm8[Y]'), 'no one length'),
    ],
)
def test_odd_times_are_one_line(tmp_path: Path, recording: Recording, times, fault: str) -> None:
    path = tmp_path / 'maps.npz'
    np.savez(path, maps=recording.concentration[:2], time=np.array(times))
    with pytest.raises(InputError, match=re.escape(fault)):
        imported(path)
