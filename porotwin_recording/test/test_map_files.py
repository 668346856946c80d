"""Files with tracer maps are found by their content."""

from pathlib import Path

import netCDF4
import numpy as np
import pytest
from recording_examples import bench_experiment

from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.dataset_export import export_dataset
from porotwin_recording.experiment.experiment_folder import read_folder, write_folder
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.map_files import files_with_maps


def test_maps_are_found_by_their_variable_and_not_by_their_name(tmp_path: Path) -> None:
    write_folder(tmp_path, bench_experiment())
    (tmp_path / 'concentration.nc').rename(tmp_path / 'tracer.nc')
    (tmp_path / 'broken.nc').write_bytes((tmp_path / 'tracer.nc').read_bytes()[:300])
    with netCDF4.Dataset(tmp_path / 'depth.nc', 'w') as dataset:
        for name in ('z', 'x'):
            dataset.createDimension(name, 2)
        dataset.createVariable('concentration', 'f4', ('z', 'x'))[:] = np.ones((2, 2))
    assert files_with_maps(tmp_path) == ['tracer.nc']


def test_a_folder_with_misnamed_maps_alone_names_them(tmp_path: Path) -> None:
    write_folder(tmp_path, bench_experiment())
    (tmp_path / 'concentration.nc').rename(tmp_path / 'tracer.nc')
    for name in ('rates.csv', 'imaging.csv'):
        (tmp_path / name).unlink(missing_ok=True)
    with pytest.raises(InputError, match=r'tracer\.nc holds its maps, name it concentration\.nc'):
        read_folder(tmp_path)


def test_any_path_is_one_of_a_zarr_folder(tmp_path: Path) -> None:
    folder = tmp_path / 'run #2, 50 %, größe'
    write_folder(folder, bench_experiment())
    export_dataset(open_recording(folder), folder / 'maps.zarr', 'zarr')
    assert (folder / 'maps.zarr' / '.zmetadata').is_file()
