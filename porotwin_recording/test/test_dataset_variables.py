"""A recording in a notebook: as an xarray dataset, and as a table."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.dataset_export import export_dataset
from porotwin_recording.experiment.recording import Recording, open_recording

xarray = pytest.importorskip('xarray', reason='needs the extra formats')

BAG = Path(__file__).parents[2] / 'bags' / 'sample'


@pytest.fixture(scope='module')
def sample() -> Recording:
    return open_recording(BAG)


def test_the_dataset_is_the_one_that_export_writes(sample: Recording, tmp_path: Path) -> None:
    export_dataset(sample, tmp_path / 'sample.nc', 'netcdf')
    with xarray.open_dataset(tmp_path / 'sample.nc', decode_times=False) as written:
        xarray.testing.assert_allclose(sample.to_xarray().astype(written.dtypes), written)
    data = sample.to_xarray()
    np.testing.assert_array_equal(data.concentration, sample.concentration)
    assert data.concentration.attrs['units'] == '1'


def test_a_notebook_shows_the_contents(sample: Recording) -> None:
    table = sample._repr_html_()
    assert '<td>13, 0 to 360 s, 187x112</td>' in table
    bare = dataclasses.replace(
        sample, maps=None, commanded=None, measured=None, source=Path('a<b>')
    )
    assert 'a&lt;b&gt;' in bare._repr_html_()
    assert 'maps' not in bare._repr_html_()


def test_without_maps_there_is_no_dataset(sample: Recording) -> None:
    with pytest.raises(InputError, match='no concentration maps'):
        dataclasses.replace(sample, maps=None).to_xarray()


def test_the_accessor_sums_tracer_over_the_pores(sample: Recording, tmp_path: Path) -> None:
    pores = sample.rig.cell_pore_volume(sample.grid)
    data = sample.to_xarray()
    expected = [1e6 * np.nansum(pores * one) for one in sample.concentration]
    np.testing.assert_allclose(data.porotwin.tracer_ml(), expected, rtol=1e-6)
    assert data.porotwin.tracer_ml().attrs['units'] == 'ml'
    export_dataset(sample, tmp_path / 'sample.nc', 'netcdf')
    with xarray.open_dataset(tmp_path / 'sample.nc', decode_times=False) as written:
        np.testing.assert_allclose(written.porotwin.pore_volume, pores)
    with pytest.raises(InputError, match=r'no pore_volume.*export'):
        data.drop_vars('pore_volume').porotwin.tracer_ml()


def test_the_accessor_has_the_error_of_evaluate(sample: Recording) -> None:
    data = sample.to_xarray()
    other = data.copy(deep=True)
    other.concentration[:, :3] = np.nan  # a hidden row counts in neither
    other.concentration[:] *= 1.5
    np.testing.assert_allclose(other.porotwin.error_to(data)[1:], 0.5, rtol=1e-6)
    nothing = data.assign(concentration=0.0 * data.concentration)
    assert np.isnan(data.porotwin.error_to(nothing)).all()
    with pytest.raises(InputError, match='other times or cells'):
        data.porotwin.error_to(data.isel(x=slice(5)))


def test_darsia_gets_images_in_its_orientation(sample: Recording) -> None:
    arguments = sample.to_xarray().porotwin.darsia_arguments()
    assert arguments['dimensions'] == pytest.approx([sample.rig.height_m, sample.rig.width_m])
    np.testing.assert_array_equal(arguments['img'][0, :, -1], sample.concentration[-1, -1])
    darsia = pytest.importorskip('darsia', reason='DarSIA has no wheel; its checkout serves too')
    image = darsia.Image(**arguments)
    well = sample.rig.wells['injector']
    row, column = image.coordinatesystem.voxel(darsia.Coordinate([well.x_m, well.z_m]))
    data = sample.to_xarray().concentration.isel(time=-1)
    at_well = data.sel(x=well.x_m, z=well.z_m, method='nearest')
    assert image.img[row, column, -1] == pytest.approx(float(at_well))
    assert image.time == list(sample.times)
