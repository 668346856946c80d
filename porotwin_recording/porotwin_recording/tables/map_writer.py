"""Writes a NetCDF file of maps over time, map by map; the base of files of tracer and of phases."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError, write_error
from porotwin_core.geometry.grid import Grid

_TIMES_PER_CHUNK = 4096
"""A NetCDF chunk of one time would cost a kilobyte of memory per map."""


class MapWriter:
    """A NetCDF file of maps (nz, nx) over time, which gets its name when it is complete.

    Memory use does not depend on the number of maps. A subclass defines the variables and writes
    the maps.

    Args:
        path: the file.
        grid: the grid of the maps.

    Raises:
        InputError: the file cannot be created.
        OSError: the disk is full or fails.
    """

    def __init__(self, path: Path, grid: Grid) -> None:
        self.path = path
        self.grid = grid
        self._partial = path.with_name(path.name + '.partial')
        self._last = -np.inf
        if not path.parent.is_dir():  # the NetCDF library would say: permission denied
            raise InputError(f'{path}: there is no folder {path.parent}; make it, or name another')
        try:
            self._dataset = netCDF4.Dataset(self._partial, 'w')
        except OSError as error:
            raise write_error(path, error) from None
        self._define_coordinates()

    def _define_coordinates(self) -> None:
        dataset = self._dataset
        dataset.createDimension('time', None)
        for name, size in (('z', self.grid.nz), ('x', self.grid.nx)):
            dataset.createDimension(name, size)
        time = dataset.createVariable('time', 'f8', ('time',), chunksizes=(_TIMES_PER_CHUNK,))
        time.setncatts({'units': 's', 'long_name': 'time since the start of the experiment'})
        for name, centres in (('z', self.grid.z), ('x', self.grid.x)):
            coordinate = dataset.createVariable(name, 'f8', (name,))
            coordinate.setncatts({'units': 'm', 'long_name': f'cell centres, {name}'})
            coordinate[:] = centres

    def _define(
        self,
        name: str,
        kind: str,
        fill: int | np.float32,
        attributes: Mapping[str, Any],
        *,
        shuffle: bool = True,
    ) -> None:
        """Define the variable `name` with a map for every time."""
        try:
            variable = self._dataset.createVariable(
                name,
                kind,
                ('time', 'z', 'x'),
                zlib=True,
                shuffle=shuffle,
                chunksizes=(1, self.grid.nz, self.grid.nx),
                fill_value=fill,
            )
            variable.setncatts(attributes)
        except (OSError, RuntimeError) as error:
            raise write_error(self.path, error) from None

    def _check(self, time: float, maps: Iterable[NDArray[Any]]) -> None:
        """Raise InputError unless the `maps` are on the grid, and `time` [s] comes next."""
        for values in maps:
            if values.shape != self.grid.shape:
                raise InputError(
                    f'{self.path}: map of shape {values.shape} at {time:g} s; '
                    f'the grid has {self.grid.shape}'
                )
        check_next(self.path, time, self._last)

    def _write(self, time: float, maps: Mapping[str, NDArray[Any]]) -> None:
        """Write `maps` (nz, nx) of the variables by their names at `time` [s]."""
        number = len(self._dataset.dimensions['time'])
        try:
            for name, values in maps.items():
                self._dataset.variables[name][number] = values
            self._dataset.variables['time'][number] = time
        except (OSError, RuntimeError) as error:
            raise write_error(self.path, error) from None
        self._last = time

    def close(self) -> None:
        """Complete the file and rename it to its final name.

        Raises:
            OSError: the disk is full or fails.
        """
        try:
            self._dataset.close()
            self._partial.replace(self.path)
        except (OSError, RuntimeError) as error:
            told = write_error(self.path, error)  # before the removal makes room again
            self._partial.unlink(missing_ok=True)
            raise told from None

    def discard(self) -> None:
        """Remove what was written."""
        with suppress(OSError, RuntimeError):
            self._dataset.close()
        self._partial.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
            return
        self.discard()


def check_next(path: Path, time: float, last: float) -> None:
    """Raise InputError unless the map of the file `path` at `time` comes after `last` [s]."""
    if not time > last:
        raise InputError(
            f'{path}: map at {time:g} s after the one at {last:g} s; times must increase'
        )
