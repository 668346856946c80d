"""Writes a recording for notebooks: one NetCDF file or one zarr folder with CF attributes.

`xarray.open_dataset` and `xarray.open_zarr` open them. Each is written by its library: zarr as
version 2 with joined metadata, which every zarr reads.

Conventions: https://cfconventions.org
"""

import contextlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
from porotwin_recording.tables.one_writer import one_writer

Format = Literal['zarr', 'netcdf']

CONVENTIONS = 'CF-1.11'

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
            _consolidate(begun.path)
        begun.path.rename(target)
        begun.remove()
    except (OSError, RuntimeError) as error:
        told = write_error(target, error)  # before the removal makes room again
        begun.remove()
        raise told from None


class _WrittenMaps:
    """The maps of an export that is not complete, in a NetCDF file or a zarr folder."""

    def __init__(self, path: Path, kind: Format) -> None:
        self._dataset = netCDF4.Dataset(path, 'a') if kind == 'netcdf' else None
        self._variables = self._dataset.variables if self._dataset else _zarr_group(path, 'r+')

    def write(self, first: int, maps: Maps) -> None:
        """Write the `maps` from number `first` on, as far as the disk."""
        for name, values in maps.items():
            self._variables[name][first : first + len(values)] = values
        if self._dataset is not None:
            self._dataset.sync()

    def holds(self, first: int, maps: Maps) -> bool:
        """Return whether the `maps` from number `first` on are there.

        Raises:
            RuntimeError, OSError, LookupError, ValueError: the file is torn.
        """
        return all(
            np.array_equal(
                np.ma.filled(self._variables[name][first : first + len(values)], np.nan),
                values,
                equal_nan=True,
            )
            for name, values in maps.items()
        )

    def close(self) -> None:
        """Close the file; a zarr folder has none open."""
        if self._dataset is not None:
            self._dataset.close()


def _zarr_group(path: Path, mode: Literal['r+', 'w']) -> Any:
    import zarr  # half a second

    return zarr.open_group(path, mode=mode, zarr_format=2, use_consolidated=False)


def _consolidate(path: Path) -> None:
    """Join all metadata: a reader over a network opens one file instead of dozens."""
    import zarr

    zarr.consolidate_metadata(path, zarr_format=2)


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

    def maps(self) -> _WrittenMaps:
        """Return the maps of an interrupted export of the same recording, or of a new one."""
        if (found := self._interrupted()) is not None:
            return found
        self.remove()
        variables, about = _variables(self._recording), _about(self._recording)
        if self._kind == 'zarr':
            _define_zarr(self.path, variables, about)
        else:
            _define_netcdf(self.path, variables, about)
        return _WrittenMaps(self.path, self._kind)

    def _interrupted(self) -> _WrittenMaps | None:
        """Return the maps of an interrupted export; None if there are none to go on with.

        A kill while the disk was written may have torn them, so the last ones are compared.
        """
        try:
            count, source = self._mark.read_text(encoding='utf-8').split(' ', 1)
            if source != self._source or not self.path.exists():
                return None
            done, found = int(count), _WrittenMaps(self.path, self._kind)
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
        """Remove the rest of the export."""
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


@dataclass(frozen=True)
class _Variable:
    """A variable of the dataset; without values it is a map for every time."""

    dimensions: tuple[str, ...]
    attributes: dict[str, str]
    values: NDArray[Any] | None = None


def _about(recording: Recording) -> dict[str, Any]:
    """Return the attributes of the whole dataset."""
    rig, maps = recording.rig, recording.present_maps
    return {
        'Conventions': CONVENTIONS,
        'title': f'tracer experiment on the rig {rig.name}',
        'source': recording.source.name,
        'history': f'written by {PROGRAM}',
        'rig': rig.name,
        'viscosity_pa_s': rig.viscosity_pa_s,
        'density_kg_m3': rig.density_kg_m3,
        'calibration': maps.origin.calibration or 'not known',
    }


def _variables(recording: Recording) -> dict[str, _Variable]:
    """Return all variables; the maps have no values yet."""
    rig, grid, maps = recording.rig, recording.grid, recording.present_maps

    def of(values: Any, dimension: str, unit: str, meaning: str, **more: str) -> _Variable:
        attributes = {'units': unit, 'long_name': meaning, **more}
        return _Variable((dimension,), attributes, np.asarray(values))

    wells = list(rig.wells.values())
    now = 'time since the experiment began'
    found = {
        'time': of(recording.times, 'time', 's', now, standard_name='time', axis='T'),
        'z': of(grid.z, 'z', 'm', 'height of the cell centres', axis='Z', positive='up'),
        'x': of(grid.x, 'x', 'm', 'cell centres from the left', axis='X'),
        'well_name': _Variable(
            ('well',), {'long_name': 'names of the wells'}, np.array(list(rig.wells), dtype=object)
        ),
        'well_x': of([w.x_m for w in wells], 'well', 'm', 'distance of the wells from the left'),
        'well_z': of([w.z_m for w in wells], 'well', 'm', 'height of the wells'),
        **_rates(recording),
    }
    present = {'concentration': maps, 'deviation': maps.deviation, 'systematic': maps.systematic}
    for name, (meaning, unit) in _FIELDS.items():
        if present[name] is not None:
            found[name] = _Variable(('time', 'z', 'x'), {'units': unit, 'long_name': meaning})
    return found


def _rates(recording: Recording) -> dict[str, _Variable]:
    """Return the rates of all wells at the times of the maps, if the recording has them."""
    wells, found = list(recording.rig.wells), {}
    for name, schedule in (('commanded', recording.commanded), ('measured', recording.measured)):
        if schedule is None:
            continue
        at_times = [schedule.at(float(time)) for time in recording.times]
        rates = [[to_ml_h(at[w].rate) if w in at else 0.0 for w in wells] for at in at_times]
        shares = [[at[w].concentration if w in at else 0.0 for w in wells] for at in at_times]
        for quantity, values, unit, meaning in (
            ('rate', rates, 'ml h-1', 'rate of the pump, positive injects'),
            ('concentration', shares, '1', 'concentration of the injected fluid, 1 = stock'),
        ):
            attributes = {'units': unit, 'long_name': f'{name} {meaning}'}
            found[f'{name}_{quantity}'] = _Variable(('time', 'well'), attributes, np.array(values))
    return found


def _sizes(variables: dict[str, _Variable]) -> dict[str, int]:
    """Return the length of every dimension."""
    return {
        name: len(values)
        for name, of in (('time', 'time'), ('z', 'z'), ('x', 'x'), ('well', 'well_name'))
        if (values := variables[of].values) is not None
    }


def _define_netcdf(path: Path, variables: dict[str, _Variable], about: dict[str, Any]) -> None:
    """Define all variables in a new NetCDF file, and write all but the maps."""
    sizes = _sizes(variables)
    with contextlib.closing(netCDF4.Dataset(path, 'w')) as dataset:
        dataset.setncatts(about)
        for name, size in sizes.items():
            dataset.createDimension(name, size)
        for name, each in variables.items():
            if each.values is not None:
                kind = str if each.values.dtype == object else 'f8'
                variable = dataset.createVariable(name, kind, each.dimensions)
                variable[:] = each.values
            else:
                variable = dataset.createVariable(
                    name,
                    'f4',
                    each.dimensions,
                    chunksizes=(1, sizes['z'], sizes['x']),
                    fill_value=np.float32(np.nan),
                    zlib=True,
                    complevel=ZLIB_LEVEL,
                )
            variable.setncatts(each.attributes)


def _define_zarr(path: Path, variables: dict[str, _Variable], about: dict[str, Any]) -> None:
    """Define all arrays in a new zarr folder, and write all but the maps, one chunk each."""
    sizes = _sizes(variables)
    group = _zarr_group(path, 'w')
    group.attrs.update(about)
    for name, each in variables.items():
        attributes = {**each.attributes, '_ARRAY_DIMENSIONS': list(each.dimensions)}
        shape = tuple(sizes[dimension] for dimension in each.dimensions)
        is_text = each.values is not None and each.values.dtype == object
        array = group.create_array(
            name,
            shape=shape,
            chunks=(1, *shape[1:]) if each.values is None else shape,
            dtype=str if is_text else np.float32 if each.values is None else np.float64,
            fill_value='' if is_text else np.nan,
            attributes=attributes,
        )
        if each.values is not None:
            array[...] = each.values.astype(str) if is_text else each.values
