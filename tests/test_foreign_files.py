"""Files from other people's laboratories and programs, read where they lie.

`../shared/foreign` holds them, with what is right. Other tests make small files like them.
"""

from pathlib import Path

import netCDF4
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig, load_rig
from porotwin_imaging.photograph.exposure_time import exif_words
from porotwin_imaging.photograph.photo_file import decode
from porotwin_recording.experiment.experiment_folder import read_folder
from porotwin_recording.importers.map_import import MapAnswers, import_maps
from porotwin_recording.importers.protocol_answers import ProtocolAnswers
from porotwin_recording.importers.protocol_import import import_protocols

FOREIGN = Path(__file__).resolve().parents[1].parent / 'shared' / 'foreign'

pytestmark = pytest.mark.skipif(not FOREIGN.is_dir(), reason=f'{FOREIGN} is not here')

RIG = """
name: tank
width_m: 0.6
height_m: 0.4
depth_m: 0.01
porosity: 0.4
permeability_m2: 1.0e-10
viscosity_pa_s: 1.0e-3
density_kg_m3: 998.0
boundaries: {top: open, bottom: closed, left: closed, right: closed}
wells:
  injector: {x_m: 0.3, z_m: 0.2}
"""


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    (tmp_path / 'rig.yaml').write_text(RIG)
    return load_rig(tmp_path)


def maps_of(name: str, rig: Rig, target: Path, answers: MapAnswers | None = None):
    """Return the maps that are made of a file, and the words about it."""
    told = import_maps(FOREIGN / name, target, rig, answers or MapAnswers())
    return read_folder(target).maps, '\n'.join(told)


def log_of(name: str, rig: Rig, target: Path, **answers: object):
    """Return the recording that is made of a folder."""
    import_protocols(FOREIGN / name, target, rig, ProtocolAnswers(**answers), exposure=exif_words)
    return read_folder(target)


def test_milliseconds_since_a_date_are_read(rig: Rig, tmp_path: Path) -> None:
    maps, _ = maps_of('milliseconds_since.nc', rig, tmp_path / 'made')
    assert maps.times[:3].tolist() == [0.0, 300.25, 600.5]
    with pytest.raises(InputError, match="'milliseconds' by the file, and --time-unit says s"):
        maps_of('milliseconds_since.nc', rig, tmp_path / 'other', MapAnswers('s'))


def test_values_beyond_the_valid_range_are_counted(rig: Rig, tmp_path: Path) -> None:
    with netCDF4.Dataset(FOREIGN / 'valid_range.nc') as dataset:
        beyond = int(np.ma.getmaskarray(dataset['concentration'][:]).sum())
    maps, told = maps_of('valid_range.nc', rig, tmp_path / 'made')
    assert np.isnan(maps[:]).sum() == beyond > 0
    assert f'outside valid_range 0 to 0.5 ({beyond})' in told


def test_a_number_for_no_value_is_read_as_nan_and_counted(rig: Rig, tmp_path: Path) -> None:
    maps, told = maps_of('minus_9999.nc', rig, tmp_path / 'made')
    assert np.nanmin(maps[:]) >= 0.0
    assert f'-9999 ({np.isnan(maps[:]).sum()})' in told


def test_zarr_of_version_3_is_read(rig: Rig, tmp_path: Path) -> None:
    maps, _ = maps_of('zarr3.zarr', rig, tmp_path / 'made')
    assert maps[:].shape == (6, 40, 60)


def test_dates_of_excel_are_offered_as_the_photographs_say(rig: Rig, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        log_of('excel_1904', rig, tmp_path / 'made')
    assert '2020-05-30 14:30:05' in str(error.value)
    _, proposed = str(error.value).split('; give ')
    assert '--date-numbers excel-1904 (time zero 2024-05-31 14:30:05' in proposed
    assert 'excel-1900' not in proposed
    made = log_of('excel_1904', rig, tmp_path / 'made', date_numbers='excel-1904')
    assert [photo.time for photo in made.photos] == [-5.0, 25.0, 55.0]


def test_a_12_hour_clock_is_named_with_what_mends_it(rig: Rig, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'a 12-hour clock without am and pm; give --clock 12h-am'):
        log_of('clock_12h', rig, tmp_path / 'made')
    made = log_of('clock_12h', rig, tmp_path / 'made', clock='12h-am')
    assert made.commanded is not None
    assert [row.time for row in made.commanded.rows] == [0.0, 7200.0, 15900.0]


def test_offset_time_stands_for_offset_time_original(rig: Rig, tmp_path: Path) -> None:
    made = log_of('offset_time', rig, tmp_path / 'made')
    assert [photo.time for photo in made.photos] == [-5.0, 25.0, 55.0]


def test_a_cut_progressive_photograph_is_refused_without_a_line_of_the_decoder(capfd) -> None:
    data = (FOREIGN / 'cut_progressive_jpeg' / 'photos' / 'progcut.jpg').read_bytes()
    with pytest.raises(InputError, match='is incomplete: scans of 3 of 3 components are missing'):
        decode(data, 4)
    assert capfd.readouterr() == ('', '')
