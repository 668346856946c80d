"""Named arrays in files of other programs: NetCDF, zarr 2 and 3, npz, MATLAB and TIFF stacks."""

import base64
import contextlib
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.netcdf_file import open_netcdf
from porotwin_core.basis.regular_file import regular
from porotwin_core.rig.property_file import check_variable
from porotwin_recording.importers.words_of_languages import NAMES, plain
from porotwin_recording.tables.cf_values import netcdf_attributes

TIMES = NAMES['time']
"""Names of times, perhaps with a unit behind."""


@dataclass(frozen=True)
class NamedArray:
    """An array of a file.

    Attributes:
        read: returns the numbers as they are stored.
        shape: of the array.
        dimensions: names of its axes; empty if the file has none.
        attributes: such as units and fill value.
    """

    read: Callable[[], NDArray[Any]]
    shape: tuple[int, ...]
    dimensions: tuple[str, ...] = ()
    attributes: Mapping[str, Any] = field(default_factory=dict)


Arrays = dict[str, NamedArray]


def _of(values: NDArray[Any], **attributes: Any) -> NamedArray:
    return NamedArray(lambda: values, values.shape, (), attributes)


@contextmanager
def named_arrays(path: Path) -> Iterator[Arrays]:
    """Yield the arrays in a file or zarr folder, while it is open.

    Raises:
        InputError: it cannot be read.
    """
    reader, kind = _READERS[path.suffix.lower()]
    try:
        with reader(path) as arrays:
            yield arrays
    except (InputError, MemoryError):
        raise
    except Exception as error:  # damaged bytes make the libraries raise errors of many types
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InputError(f'{path}: not readable as {kind} ({reason}); write it again') from None


@contextmanager
def _netcdf(path: Path) -> Iterator[Arrays]:
    with contextlib.closing(open_netcdf(path)) as dataset:
        dataset.set_auto_maskandscale(False)
        inner = {} if dataset.variables else dataset.groups
        if len(inner) > 1:
            raise InputError(f'{path}: holds groups; write one of {", ".join(inner)} as a file')
        found = next(iter(inner.values()), dataset)
        yield {name: _netcdf_array(path, each) for name, each in found.variables.items()}


def _netcdf_array(path: Path, variable: netCDF4.Variable) -> NamedArray:
    def read() -> NDArray[Any]:
        check_variable(path, variable)
        return np.asarray(variable[:])

    return NamedArray(read, variable.shape, variable.dimensions, netcdf_attributes(variable))


@contextmanager
def _zarr(path: Path) -> Iterator[Arrays]:
    import zarr  # half a second

    if not path.is_dir():
        raise InputError(f'{path}: is a file, and zarr is a folder; unpack it')
    for file in path.rglob('*'):
        if not file.is_dir():
            regular(file)
    group = zarr.open_group(path, mode='r')
    if groups := sorted(name for name, _ in group.groups()):
        inner = [path / name for name in groups]
        if not list(group.arrays()):
            raise InputError(f'{path}: holds groups; name one, such as {inner[0]}')
    yield {name: _zarr_array(path, name, array) for name, array in group.arrays()}


def _zarr_array(path: Path, name: str, array: Any) -> NamedArray:
    def read() -> NDArray[Any]:
        for sizes in (array.shape, array.chunks):
            check_declared(f'{path}: {name}', (*sizes, np.float64().itemsize))
        return np.asarray(array[...])

    attributes = dict(array.attrs)
    names = getattr(array.metadata, 'dimension_names', None) or attributes.get('_ARRAY_DIMENSIONS')
    fill = attributes.get('_FillValue')
    if isinstance(fill, str):  # xarray writes the bytes of a float
        attributes['_FillValue'] = struct.unpack('<d', base64.b64decode(fill))[0]
    elif fill is None and array.metadata.zarr_format == 2 and array.fill_value:
        attributes['_FillValue'] = array.fill_value  # programs write 0 without being asked
    return NamedArray(read, array.shape, tuple(map(str, names or ())), attributes)


@contextmanager
def _npz(path: Path) -> Iterator[Arrays]:
    try:
        with np.load(regular(path), allow_pickle=False) as archive:
            for member in archive.zip.infolist():
                for sizes in ((member.file_size,), _npy_sizes(archive.zip, member)):
                    check_declared(f'{path}: {member.filename}', sizes)
            found = {name: _of(archive[name]) for name in archive.files}
    except InputError:
        raise
    except (OSError, ValueError, TypeError, zipfile.BadZipFile, EOFError) as error:
        reason = 'it is damaged' if isinstance(error, OSError | zipfile.BadZipFile) else 'no npz'
        raise InputError(
            f'{path}: not readable as npz ({reason}); copy the file again, or write its arrays of '
            'numbers with numpy.savez'
        ) from None
    yield found


def _npy_sizes(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[int, ...]:
    """Return the sizes whose product is the size of an array in a npz file [bytes]."""
    with archive.open(member) as stream:
        major, _ = np.lib.format.read_magic(stream)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
        shape, _, kind = read[min(major, 2)](stream)
        return (*shape, kind.itemsize)


@contextmanager
def _matlab(path: Path) -> Iterator[Arrays]:
    """Yield arrays with the time first; MATLAB writes (row, column, time)."""
    import scipy.io

    try:
        for name, shape, _ in scipy.io.whosmat(regular(path)):
            check_declared(f'{path}: {name}', (*shape, np.float64().itemsize))
        read = scipy.io.loadmat(path)
        found = {name: each for name, each in read.items() if isinstance(each, np.ndarray)}
    except NotImplementedError:  # version 7.3, which is HDF5
        with contextlib.closing(open_netcdf(path)) as dataset:
            dataset.set_auto_maskandscale(False)
            for each in dataset.variables.values():
                check_variable(path, each)
            found = {name: np.asarray(each[:]).T for name, each in dataset.variables.items()}
    times = {each.size for name, each in found.items() if plain(name).split('_')[0] in TIMES}
    yield {
        name: _of(_time_first(each, times) if each.ndim == 3 else _one_row(each))
        for name, each in found.items()
        if each.dtype.kind in 'biuf'
    }


def _time_first(values: NDArray[Any], times: set[int]) -> NDArray[Any]:
    """Return maps (row, column, time) with the time first; those of SciPy may have it there."""
    is_first = values.shape[0] in times and values.shape[-1] not in times
    return values if is_first else np.moveaxis(values, -1, 0)


def _one_row(values: NDArray[Any]) -> NDArray[Any]:
    """Return a row or column of a matrix as a vector, and the axis that a meshgrid repeats."""
    if values.ndim != 2 or 1 in values.shape:
        return values.ravel()
    return values[0] if np.ptp(values, axis=0).max() == 0 else values[:, 0]


@contextmanager
def _tiff(path: Path) -> Iterator[Arrays]:
    """Yield the pictures of a stack and the times that ImageJ wrote."""
    import tifffile

    with tifffile.TiffFile(regular(path)) as file:
        series = file.series[0]
        check_declared(path, (*series.shape, series.dtype.itemsize))
        axes = [axis for axis, size in zip(series.axes, series.shape, strict=True) if size > 1]
        if 'S' in axes or 'C' in axes:
            raise InputError(f'{path}: is in colours; a stack of maps has one number for each cell')
        if len(axes) != 3:
            raise InputError(f'{path}: has the axes {series.axes}; needs a stack of maps')
        about = file.imagej_metadata or {}
        interval = about.get('finterval') or (1 / about['fps'] if about.get('fps') else None)
        if interval is None:
            raise InputError(
                f'{path}: holds no times; set the frame interval in ImageJ (Image > Properties), '
                'or write maps and time_s with numpy.savez'
            )
        maps = series.asarray().squeeze()
        times = float(interval) * np.arange(len(maps))
        unit = str(about.get('tunit') or 's')
        yield {'maps': _of(maps), 'time': _of(times, units=unit)}


_READERS: dict[str, tuple[Callable[[Path], Any], str]] = {
    '.nc': (_netcdf, 'NetCDF'),
    '.nc4': (_netcdf, 'NetCDF'),
    '.cdf': (_netcdf, 'NetCDF'),
    '.h5': (_netcdf, 'HDF5'),
    '.hdf5': (_netcdf, 'HDF5'),
    '.zarr': (_zarr, 'zarr'),
    '.npz': (_npz, 'npz'),
    '.mat': (_matlab, 'a MATLAB file'),
    '.tif': (_tiff, 'TIFF'),
    '.tiff': (_tiff, 'TIFF'),
}
ARRAY_FILES = tuple(_READERS)
"""Endings of files that hold maps and nothing else, but for TIFF."""
