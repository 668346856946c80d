"""`dataset.porotwin`: tracer, errors and images of DarSIA, of a dataset with maps.

`Recording.to_xarray` brings it. Import this module for a dataset that `export` wrote.
"""

from typing import Any

import numpy as np
import xarray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import relative_error


@xarray.register_dataset_accessor('porotwin')
class DatasetAccessor:
    """What xarray calls for `dataset.porotwin`."""

    def __init__(self, dataset: xarray.Dataset) -> None:
        """Take the `dataset`, with `concentration` (time, z, x)."""
        self._dataset = dataset

    @property
    def pore_volume(self) -> xarray.DataArray:
        """Volume of the pores of each cell [m^3], (z, x).

        Raises:
            InputError: the dataset is of an older version.
        """
        if 'pore_volume' not in self._dataset:
            raise InputError('the dataset has no pore_volume; export the recording again')
        return self._dataset['pore_volume']

    def tracer_ml(self) -> xarray.DataArray:
        """Return the volume of stock in all seen cells [ml], (time,); NaN where nothing is seen.

        Raises:
            InputError: the dataset is of an older version.
        """
        volumes = self._dataset['concentration'] * self.pore_volume
        return (ML * volumes.sum(('z', 'x'), min_count=1)).assign_attrs(units='ml')

    def error_to(self, reference: xarray.Dataset) -> xarray.DataArray:
        """Return the relative error of each map, (time,), as `evaluate` has it.

        See `relative_error` for its formula.

        Raises:
            InputError: `reference` has maps at other times or on another grid.
        """
        own, other = self._dataset['concentration'], reference['concentration']
        try:
            own, other = xarray.align(own, other, join='exact')
        except ValueError:
            raise InputError(
                'the two datasets have other times or cells; take the same ones with interp_like'
            ) from None
        errors = [relative_error(*maps) for maps in zip(own.values, other.values, strict=True)]
        return xarray.DataArray(errors, {'time': own.time}, name='relative error')

    def darsia_arguments(self) -> dict[str, Any]:
        """Return the maps as arguments: `darsia.Image(**arguments)` is a series of them.

        Its `img` is (nz, nx, nt) with row 0 at the top, `dimensions` are height and width [m],
        `time` is in seconds (DarSIA 1.1, `src/darsia/image/image.py`).
        """
        data = self._dataset
        return {
            'img': np.moveaxis(data['concentration'].values[:, ::-1], 0, -1),
            'dimensions': [float(data[axis][0] + data[axis][-1]) for axis in ('z', 'x')],
            'time': data['time'].values.tolist(),
            'name': data.attrs['source'],
            **{'space_dim': 2, 'scalar': True, 'series': True},
        }
