"""Writes a recording for notebooks: one NetCDF file or one zarr folder with CF attributes.

`xarray.open_dataset` and `xarray.open_zarr` open them. The NetCDF library writes both, so that
zarr is no dependency of ours. It writes zarr of version 2, which every zarr reads. It cannot go on
with a zarr folder, so the maps of one are written here: a compressed file each.

Conventions: https://cfconventions.org; the folder: https://zarr-specs.readthedocs.io (v2).
"""

import contextlib
import json
import shutil
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, Literal

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError, write_error
from porotwin_core.basis.units import to_ml_h
from porotwin_recording.experiment.photo_source import content_mark
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.map_files import zarr_address
from porotwin_recording.tables.one_writer import one_writer

Format = Literal['zarr', 'netcdf']

CONVENTIONS = 'CF-1.11'
ZARR_METADATA = ('.zgroup', '.zattrs', '.zarray')
CONSOLIDATED = '.zmetadata'

_FIELDS = {
    'concentration': ('tracer concentration, 1 = stock, NaN = not seen', '1'),
    'deviation': ('standard deviation of the concentration', '1'),
    'systematic': ('part of the standard deviation that is the same at all times', '1'),
}

ZLIB_LEVEL: Final = 4
"""Level of the compression, from 1 (fastest) to 9 (smallest)."""

MAPS_AT_ONCE = 16
"""Maps that are read at once, and written to the disk before they count as done: an interrupted
export goes on behind them."""

Progress = Callable[[int, int], None]
"""Receives the number of finished maps, and their total."""

Maps = dict[str, NDArray[np.float32]]
"""Maps (times, nz, nx) by the name of their variable."""


def export_dataset(
    recording: Recording, target: Path, kind: Format, *, progress: Progress | None = None
) -> None:
    """Write maps, rates and rig of a recording; `target` appears when it is complete.

    The dataset has the dimensions `time`, `z`, `x` and `well`. Rates stand at the times of the
    maps, as they were commanded. Few maps are in memory at a time. After a kill or an interrupt the
    same call goes on behind the maps that are on the disk.

    Args:
        recording: the recording.
        target: the NetCDF file or the zarr folder.
        kind: which of them.
        progress: receives the progress.

    Raises:
        InputError: `target` exists, may not be written or is being written, or the recording holds
            no maps.
        OSError: the disk is full or fails.
    """
    if target.exists():
        raise InputError(f'{target}: exists already; name another or remove it')
    begun = _Begun(recording, target, kind)
    with one_writer(target):
        _export(begun, recording, target, kind, progress)


def _export(
    begun: '_Begun', recording: Recording, target: Path, kind: Format, progress: Progress | None
) -> None:
    """Write all maps, and give the export its name."""
    try:
        with contextlib.closing(begun.maps()) as written:
            for first, maps in _blocks(recording, begun.done):
                written.write(first, maps)
                begun.note(first + len(maps['concentration']))
                if progress is not None:
                    progress(begun.done, len(recording.times))
        if kind == 'zarr':
            _complete_zarr(begun.path)
        begun.path.rename(target)
        begun.remove()
    except (OSError, RuntimeError) as error:
        told = write_error(target, error)  # before the removal makes room again
        begun.remove()
        raise told from None


class _NetcdfMaps:
    """The maps of a NetCDF file that is not complete."""

    def __init__(self, path: Path) -> None:
        self._dataset = netCDF4.Dataset(path, 'a')

    def write(self, first: int, maps: Maps) -> None:
        """Write the `maps` from number `first` on, as far as the disk."""
        for name, values in maps.items():
            self._dataset.variables[name][first : first + len(values)] = values
        self._dataset.sync()

    def holds(self, first: int, maps: Maps) -> bool:
        """Return whether the `maps` from number `first` on are in the file.

        Raises:
            RuntimeError, IndexError: the file is torn.
        """
        variables = self._dataset.variables
        return all(
            np.array_equal(
                np.ma.filled(variables[name][first : first + len(values)], np.nan),
                values,
                equal_nan=True,
            )
            for name, values in maps.items()
        )

    def close(self) -> None:
        """Close the file."""
        self._dataset.close()


class _ZarrMaps:
    """The maps of a zarr folder: every map is a file, as the definition of its variable says."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def write(self, first: int, maps: Maps) -> None:
        """Write the `maps` from number `first` on."""
        for name, values in maps.items():
            for number, one in enumerate(values, start=first):
                self._file(name, number).write_bytes(_packed(one))

    def holds(self, first: int, maps: Maps) -> bool:
        """Return whether the `maps` from number `first` on are in their files.

        Raises:
            OSError: a file is missing.
        """
        return all(
            self._file(name, number).read_bytes() == _packed(one)
            for name, values in maps.items()
            for number, one in enumerate(values, start=first)
        )

    def _file(self, name: str, number: int) -> Path:
        return self._path / name / f'{number}.0.0'

    def close(self) -> None:
        """Every file is closed."""


def _packed(values: NDArray[np.float32]) -> bytes:
    """Return a map as the bytes of its file."""
    return zlib.compress(np.ascontiguousarray(values, '<f4').tobytes(), ZLIB_LEVEL)


_MAPS: dict[Format, type[_NetcdfMaps] | type[_ZarrMaps]] = {
    'netcdf': _NetcdfMaps,
    'zarr': _ZarrMaps,
}


class _Begun:
    """An export on the disk that is not complete.

    Attributes:
        path: its file or folder.
        done: number of maps that are on the disk.
    """

    def __init__(self, recording: Recording, target: Path, kind: Format) -> None:
        """Name the files of the export of `recording` to `target`."""
        self.path = target.with_name(f'.{target.name}.partial')
        self.done = 0
        self._mark = target.with_name(f'.{target.name}.done')
        self._recording, self._kind = recording, kind
        self._source = f'{recording.source.resolve()} {kind} {content_mark(recording)} {PROGRAM}'

    def maps(self) -> _NetcdfMaps | _ZarrMaps:
        """Return the maps of an interrupted export of the same recording, or of a new one."""
        if (found := self._interrupted()) is not None:
            return found
        self.remove()
        is_zarr = self._kind == 'zarr'
        address = zarr_address(self.path, 'zarr,xarray,file') if is_zarr else str(self.path)
        with contextlib.closing(netCDF4.Dataset(address, 'w')) as dataset:
            _define(dataset, self._recording, self._kind)
        return _MAPS[self._kind](self.path)

    def _interrupted(self) -> _NetcdfMaps | _ZarrMaps | None:
        """Return the maps of an interrupted export; None if there are none to go on with.

        A kill while the disk was written may have torn them, so the last ones are compared.
        """
        try:
            count, source = self._mark.read_text(encoding='utf-8').split(' ', 1)
            if source != self._source or not self.path.exists():
                return None
            done, found = int(count), _MAPS[self._kind](self.path)
            first = max(0, done - MAPS_AT_ONCE)
            if found.holds(first, _maps_between(self._recording, first, done)):
                self.done = done
                return found
            found.close()
        except (OSError, RuntimeError, ValueError, LookupError):
            pass
        return None

    def note(self, done: int) -> None:
        """Note that so many maps are on the disk."""
        self.done = done
        new = self._mark.with_suffix('.new')
        new.write_text(f'{done} {self._source}', encoding='utf-8')
        new.replace(self._mark)  # a kill may come at any moment

    def remove(self) -> None:
        """Remove what is left of the export."""
        if self.path.is_dir():
            shutil.rmtree(self.path)
        self.path.unlink(missing_ok=True)
        self._mark.unlink(missing_ok=True)


def _blocks(recording: Recording, first: int) -> Iterator[tuple[int, Maps]]:
    """Yield the maps from number `first` on, MAPS_AT_ONCE at a time, with their first number."""
    count = len(recording.times)
    for start in range(first, count, MAPS_AT_ONCE):
        yield start, _maps_between(recording, start, min(start + MAPS_AT_ONCE, count))


def _maps_between(recording: Recording, first: int, last: int) -> Maps:
    """Return the maps from number `first` to before `last`."""
    maps = recording.maps
    assert maps is not None
    series = {'concentration': maps, 'deviation': maps.deviation, 'systematic': maps.systematic}
    return {name: each[first:last] for name, each in series.items() if each is not None}


def _define(dataset: netCDF4.Dataset, recording: Recording, kind: Format) -> None:
    """Define all variables, and write all but the maps."""
    rig, grid, maps = recording.rig, recording.grid, recording.maps
    assert maps is not None
    sizes = {'time': len(recording.times), 'z': grid.nz, 'x': grid.nx, 'well': len(rig.wells)}
    for name, size in sizes.items():
        dataset.createDimension(name, size)
    dataset.setncatts(
        {
            'Conventions': CONVENTIONS,
            'title': f'tracer experiment on the rig {rig.name}',
            'source': recording.source.name,
            'history': f'written by {PROGRAM}',
            'rig': rig.name,
            'viscosity_pa_s': rig.viscosity_pa_s,
            'density_kg_m3': rig.density_kg_m3,
            'calibration': maps.origin.calibration or 'not known',
        }
    )
    _write(dataset, 'time', ('time',), recording.times, 's', 'time since the experiment began')
    _write(dataset, 'z', ('z',), grid.z, 'm', 'height of the cell centres', axis='Z', positive='up')
    _write(dataset, 'x', ('x',), grid.x, 'm', 'cell centres from the left', axis='X')
    places = {
        axis: np.array([getattr(well, axis) for well in rig.wells.values()])
        for axis in ('x_m', 'z_m')
    }
    names = dataset.createVariable('well_name', str, ('well',))
    names.setncatts({'long_name': 'names of the wells'})
    names[:] = np.array(list(rig.wells), dtype=object)
    _write(dataset, 'well_x', ('well',), places['x_m'], 'm', 'distance of the wells from the left')
    _write(dataset, 'well_z', ('well',), places['z_m'], 'm', 'height of the wells')
    _write_rates(dataset, recording)
    present = {'concentration': maps, 'deviation': maps.deviation, 'systematic': maps.systematic}
    for name, (meaning, unit) in _FIELDS.items():
        if present[name] is not None:
            variable = dataset.createVariable(
                name,
                'f4',
                ('time', 'z', 'x'),
                chunksizes=(1, grid.nz, grid.nx),
                fill_value=np.float32(np.nan),
                zlib=True,
                complevel=ZLIB_LEVEL,
                shuffle=kind == 'netcdf',  # the library describes it wrongly in zarr
            )
            variable.setncatts({'units': unit, 'long_name': meaning})


def _write_rates(dataset: netCDF4.Dataset, recording: Recording) -> None:
    """Write the rates of all wells at the times of the maps, if the recording has them."""
    wells = list(recording.rig.wells)
    for name, schedule in (('commanded', recording.commanded), ('measured', recording.measured)):
        if schedule is None:
            continue
        at_times = [schedule.at(float(time)) for time in recording.times]
        rates = [[to_ml_h(at[w].rate) if w in at else 0.0 for w in wells] for at in at_times]
        shares = [[at[w].concentration if w in at else 0.0 for w in wells] for at in at_times]
        rate = f'{name} rate of the pump, positive injects'
        _write(dataset, f'{name}_rate', ('time', 'well'), np.array(rates), 'ml h-1', rate)
        share = f'{name} concentration of the injected fluid, 1 = stock'
        _write(dataset, f'{name}_concentration', ('time', 'well'), np.array(shares), '1', share)


def _write(
    dataset: netCDF4.Dataset,
    name: str,
    dimensions: tuple[str, ...],
    values: NDArray[Any],
    unit: str,
    meaning: str,
    **more: str,
) -> None:
    variable = dataset.createVariable(name, 'f8', dimensions)
    standard = {'standard_name': 'time', 'axis': 'T'} if name == 'time' else {}
    variable.setncatts({'units': unit, 'long_name': meaning, **standard, **more})
    variable[:] = values


def _complete_zarr(folder: Path) -> None:
    """Make units texts again, which the library writes as numbers, and join all metadata.

    With the joined metadata a reader over a network opens one file instead of dozens.
    """
    for path in folder.rglob('.zattrs'):
        found = json.loads(path.read_text(encoding='utf-8'))
        if 'units' in found:
            found['units'] = str(found['units'])
            path.write_text(json.dumps(found), encoding='utf-8')
    metadata = {
        str(path.relative_to(folder)): json.loads(path.read_text(encoding='utf-8'))
        for path in sorted(folder.rglob('.z*'))
        if path.name in ZARR_METADATA
    }
    joined = {'zarr_consolidated_format': 1, 'metadata': metadata}
    (folder / CONSOLIDATED).write_text(json.dumps(joined), encoding='utf-8')
