"""Tests of experiment folders: they are read as written, and faults are named."""

import random
import re
from pathlib import Path

import numpy as np
import pytest
from recording_examples import (
    SCHEDULE,
    SHARED,
    bench_experiment,
    bench_rig,
    controlled_rig,
    random_maps,
    two_photos,
)

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_recording.experiment.experiment_folder import folder_data, read_folder, write_folder
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.recorded_data import RecordedData

needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason='the shared recordings are not beside the checkout'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_folder(tmp_path / 'experiment', bench_experiment())
    return tmp_path / 'experiment'


def test_experiment_comes_back_bit_for_bit(folder: Path) -> None:
    experiment = read_folder(folder)
    assert experiment.rig == bench_rig()
    assert experiment.commanded == SCHEDULE
    maps = random_maps(bench_rig())
    assert experiment.maps is not None
    assert experiment.maps.times.tobytes() == maps.times.tobytes()
    assert experiment.maps.grid == maps.grid
    assert np.asarray(experiment.maps).tobytes() == maps[:].tobytes()
    for photo, original in zip(experiment.photos, two_photos(), strict=True):
        assert (photo.time, photo.role, photo.name) == (
            original.time,
            original.role,
            original.name,
        )
        assert photo.read() == original.read()


def test_photos_without_times_are_named(folder: Path) -> None:
    (folder / 'imaging.csv').unlink()
    with pytest.raises(InputError, match=r'photos/ but no imaging.csv'):
        read_folder(folder)


def test_photographs_without_imaging_csv_are_told(folder: Path) -> None:
    for name in ('imaging.csv', 'concentration.nc'):
        (folder / name).unlink(missing_ok=True)
    (folder / 'photos').rename(folder / 'DCIM')
    (remark,) = folder_data(folder).remarks
    assert re.search(r'photographs lie here, such as DCIM/.*, but there is no imaging.csv', remark)


def test_a_folder_of_something_else_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='not an experiment folder'):
        read_folder(tmp_path, bench_rig())
    with pytest.raises(InputError, match=r'rig.yaml: no such file'):
        read_folder(tmp_path)


def test_writing_over_an_experiment_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match='holds an experiment already'):
        write_folder(folder, RecordedData(bench_rig()))


@needs_shared
def test_every_shared_recording_survives_a_copy(tmp_path: Path) -> None:
    for case in ('case_001', 'case_014'):
        original = open_recording(SHARED / 'cases' / case)
        copy = tmp_path / case
        write_folder(copy, original)
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


@pytest.mark.parametrize('name', ['concentration.nc', 'rates.csv', 'imaging.csv'])
def test_random_damage_is_named_in_one_line(tmp_path: Path, name: str) -> None:
    write_folder(tmp_path / 'run', bench_experiment())
    path = tmp_path / 'run' / name
    whole = path.read_bytes()
    for seed in range(100):
        generator = random.Random(seed)
        content = bytearray(whole)
        for _ in range(generator.choice([1, 10, 100])):
            place = generator.randrange(len(content))
            content[place] = generator.choice([0, 255, 34, 44, 10, generator.randrange(256)])
        path.write_bytes(content[: generator.choice([None, generator.randrange(len(content))])])
        try:
            recording = open_recording(tmp_path / 'run')
            assert recording.concentration.shape[1:] == recording.grid.shape
        except InputError as error:
            assert '\n' not in str(error)


def test_the_odd_values_of_a_replaced_rig_are_not_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    odd = controlled_rig().model_copy(update={'porosity': 0.15})
    write_folder(tmp_path, RecordedData(odd))
    (tmp_path / 'rates.csv').write_text('time_s,well,rate_ml_h,concentration\n0,in,0,1\n')
    found = folder_data(tmp_path, controlled_rig())
    assert found.replaced_rig == odd
    assert 'porosity' not in caplog.text
    folder_data(tmp_path)
    assert 'porosity is 0.15' in caplog.text


def test_impossible_rates_are_refused_and_odd_ones_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_folder(tmp_path, RecordedData(controlled_rig()))
    for rate, refused in (('5.6e-8', True), ('20000', False)):
        rows = f'time_s,well,rate_ml_h,concentration\n0,in,{rate},1\n'
        (tmp_path / 'rates.csv').write_text(rows)
        if refused:
            with pytest.raises(InputError, match='was this in m3/s'):
                read_folder(tmp_path)
        else:
            assert read_folder(tmp_path).commanded is not None
            assert 'well in is 20000 ml/h' in caplog.text
