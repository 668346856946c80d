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
