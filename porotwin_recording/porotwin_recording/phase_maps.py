"""Maps of phases on disk: a NetCDF file with a number for each phase, by the CF conventions."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError, write_error
from porotwin_core.grid import Grid

NO_PHASE = 255
"""Fill value: cells without a phase."""
_COMPRESSION_LEVEL: Final = 4
_TIMES_PER_CHUNK = 4096
"""A NetCDF chunk of one time would cost a kilobyte of memory per map."""


class PhaseMapWriter:
    """Writes maps of phases one by one; the file gets its name when it is complete.

    Args:
        path: the file.
        grid: the grid of the maps.
        phases: names of the phases; their numbers are the indices.
        program: name and version of the program.
        colours: the colours of the phases in words.

    Raises:
        InputError: the file cannot be created.
        OSError: the disk is full, when the file is made, or in `append` and at the end.
    """

    def __init__(
        self,
        path: Path,
        grid: Grid,
        phases: Sequence[str],
        *,
        program: str = '',
        colours: Sequence[str] = (),
    ) -> None:
        self._path = path
        self._partial = path.with_name(path.name + '.partial')
        self._grid = grid
        self._last = -np.inf
        if not path.parent.is_dir():  # the NetCDF library would say: permission denied
            raise InputError(f'{path}: there is no folder {path.parent}; make it, or name another')
        try:
            self._dataset = netCDF4.Dataset(self._partial, 'w')
        except OSError as error:
            raise write_error(path, error) from None
        self._dataset.setncatts(
            {'Conventions': 'CF-1.11', 'program': program, 'colours': '; '.join(colours)}
        )
        self._define_coordinates()
        self._define('phase', 'u1', NO_PHASE).setncatts(
            {
                'long_name': 'phase in the pores',
                'flag_values': np.arange(len(phases), dtype=np.uint8),
                'flag_meanings': ' '.join(phases),
            }
        )
        self._define('confidence', 'f4', np.float32(np.nan)).setncatts(
            {'units': '1', 'long_name': 'probability of the phase'}
        )

    def _define_coordinates(self) -> None:
        self._dataset.createDimension('time', None)
        time = self._dataset.createVariable('time', 'f8', ('time',), chunksizes=(_TIMES_PER_CHUNK,))
        time.setncatts({'units': 's', 'long_name': 'time since the start of the experiment'})
        for name, centres in (('z', self._grid.z), ('x', self._grid.x)):
            self._dataset.createDimension(name, len(centres))
            coordinate = self._dataset.createVariable(name, 'f8', (name,))
            coordinate.setncatts({'units': 'm', 'long_name': f'cell centres, {name}'})
            coordinate[:] = centres

    def _define(self, name: str, kind: str, fill: int | np.float32) -> netCDF4.Variable:
        return self._dataset.createVariable(
            name,
            kind,
            ('time', 'z', 'x'),
            zlib=True,
            complevel=_COMPRESSION_LEVEL,
            chunksizes=(1, self._grid.nz, self._grid.nx),
            fill_value=fill,
        )

    def append(self, time: float, phase: NDArray[np.uint8], confidence: NDArray) -> None:
        """Write a map of phases (nz, nx) and their probability [-] at `time` [s].

        Raises:
            InputError: `time` does not increase.
        """
        if not time > self._last:
            raise InputError(
                f'{self._path}: map at {time:g} s after the one at {self._last:g} s; '
                'times must increase'
            )
        self._last = time
        number = len(self._dataset.dimensions['time'])
        try:
            self._dataset.variables['phase'][number] = phase
            self._dataset.variables['confidence'][number] = confidence
            self._dataset.variables['time'][number] = time
        except (OSError, RuntimeError) as error:
            raise write_error(self._path, error) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            with suppress(OSError, RuntimeError):
                self._dataset.close()
            self._partial.unlink(missing_ok=True)
            return
        try:
            self._dataset.close()
            self._partial.replace(self._path)
        except (OSError, RuntimeError) as error:
            told = write_error(self._path, error)  # before the removal makes room again
            self._partial.unlink(missing_ok=True)
            raise told from None
