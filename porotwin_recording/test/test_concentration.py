"""Tests of concentration.nc: maps are read as written, and faults of a file are named."""

import logging
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from recording_examples import bench_rig, random_maps

from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.concentration import (
    ConcentrationMaps,
    ConcentrationWriter,
    open_maps,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    maps = random_maps(bench_rig())
    with ConcentrationWriter(tmp_path / 'concentration.nc', maps.grid) as writer:
        for time, frame in zip(maps.times, maps, strict=True):
            writer.append(time, frame)
    return tmp_path / 'concentration.nc'


def read(path: Path) -> ConcentrationMaps:
    return open_maps(path, bench_rig())


def test_packed_maps_come_back_within_half_a_step(tmp_path: Path) -> None:
    rig = bench_rig()
    maps = random_maps(rig)
    path = tmp_path / 'concentration.nc'
    with ConcentrationWriter(path, maps.grid, packed=True) as writer:
        for time, frame in zip(maps.times, maps, strict=True):
            writer.append(time, frame)
    with netCDF4.Dataset(path) as dataset:
        dataset.set_auto_maskandscale(False)
        assert dataset['concentration'].dtype == np.uint8
    # half a step of 0.004, plus the float32 round-off of a value near 1
    np.testing.assert_allclose(open_maps(path, rig)[:], maps[:], rtol=0, atol=0.002 + 1e-6)


def test_index_slice_and_iteration_give_the_same_maps(path: Path) -> None:
    maps = read(path)
    everything = maps[:]
    np.testing.assert_array_equal(maps[-1], everything[-1])
    np.testing.assert_array_equal(maps[1:4:2], everything[1:4:2])
    np.testing.assert_array_equal(maps[::-1], everything[::-1])
    np.testing.assert_array_equal(list(maps), everything)
    with pytest.raises(IndexError):
        maps[5]


def test_unix_times_are_refused(path: Path) -> None:
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset['time'][:] += 1.75e9
    with pytest.raises(InputError, match=r'of frame \d is .*Unix time'):
        read(path)


def test_a_failing_writer_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / 'concentration.nc'
    rig = bench_rig()
    with (
        pytest.raises(InputError, match='times must increase'),
        ConcentrationWriter(path, rig.grid(2, 2)) as writer,
    ):
        writer.append(3.0, np.zeros((2, 2)))
        writer.append(3.0, np.zeros((2, 2)))
    assert list(tmp_path.iterdir()) == []


def change(path: Path, name: str, values: object) -> None:
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset[name][:] = values


def test_maps_of_another_rig_are_named(path: Path) -> None:
    change(path, 'x', (np.arange(8) + 0.5) * 0.1)
    with pytest.raises(InputError, match=r'x runs from 0.05 to 0.75 m in 8 cells.*width_m 0.4'):
        read(path)


def test_maps_with_z_downward_are_named(path: Path) -> None:
    change(path, 'z', ((np.arange(6) + 0.5) * 0.05)[::-1])
    with pytest.raises(InputError, match=r'z runs from 0.275 to 0.025 m'):
        read(path)


def test_maps_out_of_order_are_named(path: Path) -> None:
    change(path, 'time', [0, 30, 30, 60, 90])
    with pytest.raises(InputError, match='time 30 of frame 2 does not come after 30'):
        read(path)


def test_maps_without_times_are_named(path: Path) -> None:
    change(path, 'time', np.nan)
    with pytest.raises(InputError, match='time holds values that are not finite'):
        read(path)


def test_a_truncated_map_file_is_named(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(InputError, match=r'concentration.nc: not a readable NetCDF file'):
        read(path)


def test_a_map_file_without_concentration_is_named(path: Path) -> None:
    with netCDF4.Dataset(path, 'w') as dataset:
        dataset.createDimension('time', 1)
    with pytest.raises(InputError, match="has no variable 'concentration'"):
        read(path)


@pytest.mark.parametrize(
    ('name', 'unit'), [('time', 'min'), ('time', 'minutes since 2024-05-06'), ('x', 'mm')]
)
def test_coordinates_in_other_units_are_named(path: Path, name: str, unit: str) -> None:
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset[name].units = unit
    with pytest.raises(InputError, match=f"units of {name} are '{unit}'"):
        read(path)


@pytest.mark.parametrize('unit', ['%', 'g/l', 'mol m-3'])
def test_concentrations_in_other_units_are_named(path: Path, unit: str) -> None:
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset['concentration'].units = unit
    with pytest.raises(InputError, match=f"units of concentration are '{unit}'; divide it by"):
        read(path)


@pytest.mark.parametrize('unit', ['', '-', '1'])
def test_numbers_without_a_unit_are_read(path: Path, unit: str) -> None:
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset['concentration'].units = unit
        dataset['time'].units = 'seconds since 2024-05-06 12:00'
    assert len(read(path)) == 5


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='absent; make it'):
        ConcentrationWriter(tmp_path / 'absent' / 'maps.nc', bench_rig().grid(2, 2))


@pytest.mark.parametrize('value', [np.inf, 1e30, -1e20, -9999.0, -1.0])
def test_impossible_concentrations_are_read_as_unknown_and_told(
    path: Path, caplog, value: float
) -> None:
    with netCDF4.Dataset(path, 'a') as dataset:
        dataset['concentration'][1, 2, 3] = value
    with caplog.at_level(logging.WARNING, logger='porotwin'):
        found = read(path)[:]
    assert np.isnan(found[1, 2, 3])
    assert np.nanmax(np.abs(found)) < 10.0
    assert '1 of 240 values are read as not known' in caplog.text
