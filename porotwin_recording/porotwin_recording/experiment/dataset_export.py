"""Writes a recording for notebooks: one NetCDF file or one zarr folder with CF attributes.

`xarray.open_dataset` and `xarray.open_zarr` open them. Each is written by its library: zarr as
version 2 with joined metadata, which every zarr reads.
"""

import contextlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import netCDF4
import numpy as np

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError, write_error
from porotwin_recording.experiment.dataset_variables import (
    Maps,
    Variable,
    about,
    maps_between,
    variables,
)
from porotwin_recording.experiment.photo_source import content_mark
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import MAPS_AT_ONCE
from porotwin_recording.tables.one_writer import one_writer

Format = Literal['zarr', 'netcdf']


Progress = Callable[[int, int], None]
"""Receives the number of finished maps, and their total."""


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
        recording, maps = self._recording, self._recording.present_maps
        define = _define_zarr if self._kind == 'zarr' else _define_netcdf
        words = about(recording.rig, maps, recording.source.name)
        define(self.path, variables(recording, maps), words)
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
            if found.holds(first, maps_between(self._recording.present_maps, first, done)):
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
        yield start, maps_between(recording.present_maps, start, min(start + MAPS_AT_ONCE, count))


def _sizes(variables: dict[str, Variable]) -> dict[str, int]:
    """Return the length of every dimension."""
    return {
        name: len(values)
        for name, of in (('time', 'time'), ('z', 'z'), ('x', 'x'), ('well', 'well_name'))
        if (values := variables[of].values) is not None
    }


def _define_netcdf(path: Path, variables: dict[str, Variable], about: dict[str, Any]) -> None:
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
                )
            variable.setncatts(each.attributes)


def _define_zarr(path: Path, variables: dict[str, Variable], about: dict[str, Any]) -> None:
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
