"""Maps of other programs as an experiment folder: npz, CSV, NetCDF and zarr.

- npz: an array of three dimensions (time, row, column) and one of times; `x` and `z` if known.
- CSV: columns time, x, z and concentration, one line for each value, in any order.
- NetCDF, zarr (version 2): dimensions time, z or y, x, in any order, with coordinates.
"""

import contextlib
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import regular
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.rig import Rig
from porotwin_core.rig.property_file import check_variable
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.importers.foreign_table import Decimal, read_foreign_table
from porotwin_recording.importers.foreign_units import LENGTHS, time_factor, unit_in
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.map_files import zarr_address
from porotwin_recording.tables.recorded_data import RecordedData

ARRAY_FILES = ('.npz', '.nc', '.zarr')
"""Endings of files that hold maps and nothing else."""

SUFFIXES = (*ARRAY_FILES, '.csv')
FirstRow = Literal['top', 'bottom']

NAMES = {
    'concentration': ('concentration', 'maps', 'c', 'tracer', 'data', 'images'),
    'time': ('time', 'times', 't'),
    'x': ('x',),
    'z': ('z', 'y', 'height'),
}
"""Names of quantities, the surest first."""

MOST_STOCK = 1.3
"""Largest concentration of noisy maps [-]; larger values are in another unit."""

LEAST_NOISE = 0.3
"""Concentration below 0 [-] that noise does not reach."""

FAR_FROM_SQUARE, NEARLY_SQUARE = 1.3, 1.1
"""Longer over shorter side of a cell: maps are taken as transposed if they have cells beyond the
first, and transposed ones below the second."""

FARTHEST_CENTRE = 0.49
"""Largest distance from a coordinate to the centre of its cell, in cells: edges of cells are half a
cell off, and round-off must not decide about them."""

LONG_AFTER = 10.0
"""Time from a reference date to the first map, in lengths of the recording, above which the date is
no begin of an experiment."""

REAL_KINDS = 'biuf'
"""Kinds of arrays that hold real numbers: truth values, integers and floats."""

PERCENT = 100.0

PERCENTS = ('%', 'percent')

AMOUNTS = re.compile(r'(kg|g|mg|ug|µg|mol|mmol|ppm|ppb)\b')
"""Begin of units of dye per volume, such as mg/l."""


@dataclass(frozen=True)
class MapAnswers:
    """Answers to open questions of maps; empty or None: as the file shows.

    Attributes:
        time_unit: unit of times, such as min.
        first_row: whether the first row of a map is at the top or the bottom.
        stock: value of the tracer stock, such as 100 for percent.
        decimal: decimal point or comma of a CSV file.
    """

    time_unit: str = ''
    first_row: FirstRow | None = None
    stock: float | None = None
    decimal: Decimal | None = None


@dataclass(frozen=True)
class _Arrays:
    """Arrays of a file: values (time, row, column), times, coordinates, and units by name.

    `downward`: z counts from the top of the rig down.
    """

    values: NDArray[Any]
    times: NDArray[Any]
    x: NDArray[Any] | None
    z: NDArray[Any] | None
    units: dict[str, str]
    downward: bool = False


def import_maps(path: Path, target: Path, rig: Rig, answers: MapAnswers) -> list[str]:
    """Write an experiment folder with the maps in a file; return the assumptions made.

    Args:
        path: a file .npz, .csv or .nc, or a folder .zarr.
        target: the new experiment folder.
        rig: the rig that the maps cover completely.
        answers: answers to the questions that the file leaves open.

    Raises:
        InputError: one line with the file, the fault and the remedy.
    """
    readers = {'.npz': _npz, '.nc': _netcdf, '.zarr': _netcdf}
    told: list[str] = []
    suffix = path.suffix.lower()
    if suffix == '.csv':
        arrays = _csv(path, answers.decimal)
    elif suffix in readers:
        arrays = readers[suffix](path)
    else:
        raise InputError(f'{path}: no file of maps; give one that ends in {", ".join(SUFFIXES)}')
    if arrays.values.ndim != 3 or len(arrays.times) != len(arrays.values):
        raise InputError(
            f'{path}: its maps have the shape {arrays.values.shape}, and it has '
            f'{len(arrays.times)} times; write maps as (time, row, column)'
        )
    if not arrays.values.size:
        raise InputError(f'{path}: its maps have the shape {arrays.values.shape}: none has a value')
    times = _seconds(path, arrays, answers, told)
    _check_coordinates(path, arrays)
    _check_cells(path, arrays, rig)
    values = _upward(path, _rightward(path, arrays, told), answers, told)
    values = _shares(path, values, arrays.units.get('concentration', ''), answers, told)
    _check_extent(path, arrays, rig)
    grid = rig.grid(values.shape[2], values.shape[1])
    maps = ConcentrationMaps(times, grid, lambda first, last: values[first:last])
    write_folder(target, RecordedData(rig, maps=maps))
    told.append(f'{path}: {len(times)} maps of {grid} cells, which cover the whole rig')
    return told


def _seconds(
    path: Path, arrays: _Arrays, answers: MapAnswers, told: list[str]
) -> NDArray[np.float64]:
    """Return the times [s] from the first one on, or from zero if they begin later."""
    times = arrays.times
    if times.ndim != 1 or times.dtype.kind not in f'{REAL_KINDS}M':
        raise InputError(f'{path}: its times are no row of numbers; write numbers or datetime64')
    if times.dtype.kind == 'M':
        shown = np.datetime_as_string(times, unit='s').tolist()
        seconds = _dated_seconds(times)
        _check_rise(path, seconds, shown)
        told.append(f'{path}: time zero is {shown[0]}, its first map')
    else:
        unit, _, epoch = (answers.time_unit or arrays.units.get('time', '')).partition(' since ')
        seconds = np.asarray(times, dtype=float) * time_factor(unit, f'{path}: time')
        shown = [f'{time:.10g}' for time in times]
        _check_rise(path, seconds, shown)
        told.append(f'{path}: times in {unit}')
        if epoch:
            seconds = _told_epoch(path, seconds, f'{shown[0]} {unit}', epoch, told)
    _check_duration(path, seconds)
    return seconds


def _told_epoch(
    path: Path, seconds: NDArray[np.float64], first: str, epoch: str, told: list[str]
) -> NDArray[np.float64]:
    """Return times [s] since `epoch`, from the first map on if it comes long after the epoch."""
    if seconds[0] > LONG_AFTER * (seconds[-1] - seconds[0]):
        told.append(f'{path}: time zero is the first map, {first} since {epoch}')
        return seconds - seconds[0]
    told.append(f'{path}: time zero is {epoch}')
    return seconds


def _dated_seconds(times: NDArray[Any]) -> NDArray[np.float64]:
    """Return dates as seconds from the first date; NaN for NaT."""
    dates = times[~np.isnat(times)]
    if not len(dates):
        return np.full(len(times), np.nan)
    seconds: NDArray[np.float64] = (times - dates[0]) / np.timedelta64(1, 's')
    return seconds


def _check_rise(path: Path, seconds: NDArray[np.float64], shown: Sequence[str]) -> None:
    """Check that times [s] increase, and that none is far from all others.

    Raises:
        InputError: they do not; the message names the first map where this shows.
    """
    missing = ~np.isfinite(seconds)
    if missing.any():
        at = int(missing.argmax())
        raise InputError(
            f'{path}: the time of map {at + 1} is {shown[at]}; write a time, or leave that map out'
        )
    far = np.abs(seconds - np.median(seconds)) > LONGEST_EXPERIMENT_S
    if 0 < far.sum() < len(far) / 2:
        at = int(far.argmax())
        raise InputError(
            f'{path}: the time of map {at + 1}, {shown[at]}, is more than a year from most '
            'others; correct it'
        )
    if np.any(np.diff(seconds) <= 0):
        at = int(np.argmax(np.diff(seconds) <= 0)) + 1
        raise InputError(
            f'{path}: its times do not increase: map {at + 1} is of {shown[at]}, the one before '
            f'it of {shown[at - 1]}; sort the maps by time'
        )


def _check_duration(path: Path, seconds: NDArray[np.float64]) -> None:
    """Compare the times [s] with those that an experiment can have.

    Raises:
        InputError: they count from another moment, or are in another unit.
    """
    if seconds[0] > LONGEST_EXPERIMENT_S:
        years = seconds[0] / LONGEST_EXPERIMENT_S
        raise InputError(
            f'{path}: its times begin at {seconds[0]:.4g} s, {years:.3g} years after '
            'zero; stamps since 1970? subtract the time at which the experiment began'
        )
    span = seconds[-1] - seconds[0]
    if span > LONGEST_EXPERIMENT_S:
        raise InputError(
            f'{path}: its times span {span:.4g} s, {span / LONGEST_EXPERIMENT_S:.3g} years; '
            'correct them, or give their unit with --time-unit, such as ms'
        )


def _check_coordinates(path: Path, arrays: _Arrays) -> None:
    """Compare the coordinates with the shape of the maps.

    Raises:
        InputError: their numbers differ, or they are missing, or do not rise or fall evenly.
    """
    _, rows, columns = arrays.values.shape
    found = {'x': arrays.x, 'z': arrays.z}
    lengths = {name: values.size for name, values in found.items() if values is not None}
    needed = {'x': columns, 'z': rows}
    if any(length != needed[name] for name, length in lengths.items()):
        crossed = {'x': rows, 'z': columns}
        fits = all(length == crossed[name] for name, length in lengths.items())
        remedy = (
            'the maps look transposed: write them as (time, row, column)'
            if fits
            else 'give a coordinate for every row and column'
        )
        words = ' and '.join(f'{length} values of {name}' for name, length in lengths.items())
        raise InputError(
            f'{path}: has {words}, but maps of {rows} rows and {columns} columns; {remedy}'
        )
    for name, values in found.items():
        if values is None:
            continue
        if values.ndim != 1 or values.dtype.kind not in REAL_KINDS or not np.isfinite(values).all():
            raise InputError(
                f'{path}: {name} is no row of finite numbers; correct it, or leave it out'
            )
        steps = np.diff(values)
        if not ((steps > 0).all() or (steps < 0).all()):
            raise InputError(
                f'{path}: {name} neither rises nor falls from cell to cell; sort {name} and the '
                'maps alike'
            )


def _check_cells(path: Path, arrays: _Arrays, rig: Rig) -> None:
    """Compare the cells of maps without coordinates with squares, which most programs use.

    Raises:
        InputError: cells are far from square, and would be nearly square if x and z were exchanged.
    """
    if arrays.x is not None or arrays.z is not None:
        return
    _, rows, columns = arrays.values.shape
    given, exchanged = (
        rig.width_m / across / (rig.height_m / upward)
        for across, upward in ((columns, rows), (rows, columns))
    )
    if _longer(given) > FAR_FROM_SQUARE and _longer(exchanged) < NEARLY_SQUARE:
        raise InputError(
            f'{path}: maps of {rows} rows and {columns} columns look transposed: cells of the rig '
            f'would be {1e3 * rig.width_m / columns:.3g} x {1e3 * rig.height_m / rows:.3g} mm; '
            'write them as (time, row, column), or give x and z of the cells'
        )


def _longer(ratio: float) -> float:
    """Return the longer over the shorter side of a cell."""
    return max(ratio, 1.0 / ratio)


def _falls(values: NDArray[Any] | None) -> bool:
    return values is not None and len(values) > 1 and bool(values[1] < values[0])


def _rightward(path: Path, arrays: _Arrays, told: list[str]) -> _Arrays:
    """Return the arrays with the leftmost column first."""
    if not _falls(arrays.x):
        return arrays
    told.append(f'{path}: x falls: the maps are turned from left to right')
    return replace(arrays, values=arrays.values[:, :, ::-1])


def _upward(path: Path, arrays: _Arrays, answers: MapAnswers, told: list[str]) -> NDArray[Any]:
    """Return the maps with the lowest row first.

    Raises:
        InputError: nothing says which row is at the top, or z and --first-row differ.
    """
    if arrays.z is not None and len(arrays.z) > 1:
        falls = _falls(arrays.z)
        shown: FirstRow = 'top' if falls != arrays.downward else 'bottom'
        counts = ' from the top down (positive: down)' if arrays.downward else ''
        why = f'z {"falls" if falls else "rises"}{counts}, so that the first row is at the {shown}'
        if answers.first_row not in (None, shown):
            raise InputError(
                f'{path}: {why}, but --first-row says {answers.first_row}; leave it out, or '
                'correct z'
            )
        if arrays.downward:
            told.append(f'{path}: {why}')
        return arrays.values if shown == 'bottom' else arrays.values[:, ::-1]
    if answers.first_row is None:
        raise InputError(
            f'{path}: nothing says whether the first row of a map is at the top, as in a picture; '
            'give --first-row top or --first-row bottom'
        )
    told.append(f'{path}: the first row of a map is at the {answers.first_row}')
    return arrays.values if answers.first_row == 'bottom' else arrays.values[:, ::-1]


def _refuse_other_unit(path: Path, unit: str, largest: float) -> None:
    """Check that the file does not state another `unit` than a share of the tracer stock.

    Raises:
        InputError: it does; the line asks for the value of the stock.
    """
    if unit in PERCENTS and largest <= MOST_STOCK:
        raise InputError(
            f"{path}: concentrations are in '{unit}', but reach only {largest:.3g}; give "
            '--stock 100 if they are in percent of the tracer stock, and --stock 1 if not'
        )
    if AMOUNTS.match(unit):
        raise InputError(
            f"{path}: concentrations are in '{unit}'; give --stock, the value of the tracer stock "
            'in this unit'
        )


def _shares(
    path: Path, values: NDArray[Any], unit: str, answers: MapAnswers, told: list[str]
) -> NDArray[np.float32]:
    """Return the maps, whose file states `unit`, as shares of the tracer stock.

    Raises:
        InputError: the values are in another unit, and nothing says which value is the stock.
    """
    if answers.stock is not None and not 0.0 < answers.stock < np.inf:
        raise InputError(f'--stock {answers.stock:g}: give a finite number above 0, such as 100')
    if values.dtype.kind not in REAL_KINDS:
        raise InputError(f'{path}: its maps are of the type {values.dtype}; write real numbers')
    floats = np.asarray(values, dtype=np.float32)
    if np.isnan(floats).all():
        raise InputError(f'{path}: all values of its maps are missing')
    infinite = int(np.isinf(floats).sum())
    if infinite:
        raise InputError(
            f'{path}: {infinite} values of its maps are infinite, or too large for 32 bits; '
            'write NaN where there is no value'
        )
    least, largest = float(np.nanmin(floats)), float(np.nanmax(floats))
    if largest <= 0.0 and least < 0.0:
        raise InputError(
            f'{path}: concentrations lie between {least:.3g} and {largest:.3g}, none is above 0; '
            'correct their sign: 0 is water, 1 is tracer stock'
        )
    if least < -LEAST_NOISE * (answers.stock or 1.0):
        told.append(f'{path}: concentrations go down to {least:.3g}, although 0 is water')
    if answers.stock is None:
        _refuse_other_unit(path, unit, largest)
    if answers.stock is None and largest > MOST_STOCK:
        percent = 'for percent ' if largest <= MOST_STOCK * PERCENT else ''
        raise InputError(
            f'{path}: concentrations reach {largest:.3g}; give --stock, the value of the tracer '
            f'stock, {percent}such as --stock {PERCENT if percent else largest:g}'
        )
    if answers.stock is None:
        return floats
    told.append(f'{path}: {answers.stock:g} is tracer stock')
    return floats / np.float32(answers.stock)


def _check_extent(path: Path, arrays: _Arrays, rig: Rig) -> None:
    """Compare the coordinates with the size of the rig.

    Raises:
        InputError: the maps do not cover the rig.
    """
    for name, values, size in (('x', arrays.x, rig.width_m), ('z', arrays.z, rig.height_m)):
        if values is None or len(values) < 2:
            continue
        factor = LENGTHS.get(arrays.units.get(name, '') or 'm')
        if factor is None:
            raise InputError(f"{path}: {name} is in '{arrays.units[name]}'; write m, cm or mm")
        centres = np.sort(np.asarray(values, dtype=float)) * factor
        step = size / len(centres)
        expected = step * (np.arange(len(centres)) + 0.5)
        if np.abs(centres - expected).max() > FARTHEST_CENTRE * step:
            raise InputError(
                f'{path}: {name} runs from {centres[0]:g} to {centres[-1]:g} m in {len(centres)} '
                f'cells, but the rig is {size:g} m, and the centres of its cells run from '
                f'{expected[0]:g} to {expected[-1]:g} m; give a map of the whole rig with the '
                'centres of its cells, or mend rig.yaml'
            )


def _chosen(path: Path, names: list[str], quantity: str) -> str | None:
    """Return the name of a quantity among `names`; units at its end do not count."""
    for wanted in NAMES[quantity]:
        for name in names:
            if name.lower() == wanted:
                return name
        found = [name for name in names if re.split(r'[_\s\[(]', name.lower())[0] == wanted]
        if len(found) > 1:
            raise InputError(
                f'{path}: which {quantity} is meant, {found[0]} or {found[1]}? name it {wanted}'
            )
        if found:
            return found[0]
    if quantity in ('concentration', 'time'):
        raise InputError(f'{path}: has no {quantity}; it holds {", ".join(names)}')
    return None


def _npz(path: Path) -> _Arrays:
    try:
        with np.load(regular(path), allow_pickle=False) as archive:
            for member in archive.zip.infolist():
                for sizes in ((member.file_size,), _npy_sizes(archive.zip, member)):
                    check_declared(f'{path}: {member.filename}', sizes)
            found = {name: archive[name] for name in archive.files}
    except InputError:
        raise
    except (OSError, ValueError, TypeError, zipfile.BadZipFile, EOFError) as error:
        reason = 'it is damaged' if isinstance(error, OSError | zipfile.BadZipFile) else 'no npz'
        raise InputError(
            f'{path}: not readable as npz ({reason}); copy the file again, or write its arrays of '
            'numbers with numpy.savez'
        ) from None
    names = {quantity: _chosen(path, list(found), quantity) for quantity in NAMES}
    return _Arrays(
        found[str(names['concentration'])],
        np.atleast_1d(found[str(names['time'])]),
        None if names['x'] is None else found[names['x']],
        None if names['z'] is None else found[names['z']],
        {quantity: unit_in(name) for quantity, name in names.items() if name},
    )


def _npy_sizes(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[int, ...]:
    """Return the sizes whose product is the size of an array in a npz file [bytes]."""
    with archive.open(member) as stream:
        major, _ = np.lib.format.read_magic(stream)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
        shape, _, kind = read[min(major, 2)](stream)
        return (*shape, kind.itemsize)


def _csv(path: Path, decimal: Decimal | None) -> _Arrays:
    """Return the maps of a long table; a value that is empty or not there is missing (NaN)."""
    table = read_foreign_table(path, decimal)
    titles = {quantity: table.needed(*NAMES[quantity]) for quantity in NAMES}
    title = titles['concentration']
    words = ['' if word.lower() == 'nan' else word for word in table.columns[title]]
    seen = [bool(word) for word in words]
    table = replace(table, columns={**table.columns, title: words})
    needed = {quantity: seen if quantity == 'concentration' else () for quantity in NAMES}
    columns = {q: np.array(table.numbers(titles[q], needed[q])) for q in NAMES}
    axes = {name: np.unique(columns[name], return_inverse=True) for name in ('time', 'z', 'x')}
    check_declared(path, (*(len(axes[name][0]) for name in axes), np.float32().itemsize))
    values = np.full([len(axes[name][0]) for name in axes], np.nan, dtype=np.float32)
    places = tuple(axes[name][1] for name in axes)
    _refuse_repeated(path, axes, places)
    values[places] = np.where(seen, columns['concentration'], np.nan)
    units = {name: unit_in(title) for name, title in titles.items()}
    return _Arrays(values, axes['time'][0], axes['x'][0], axes['z'][0], units)


def _refuse_repeated(
    path: Path, axes: dict[str, Any], places: tuple[NDArray[np.intp], ...]
) -> None:
    """Check that a table has one value at each time and place.

    Raises:
        InputError: it has more; the line names the first such place.
    """
    lines, counts = np.unique(np.column_stack(places), axis=0, return_counts=True)
    if counts.max(initial=0) > 1:
        at = lines[int(counts.argmax())]
        time, z, x = (axes[name][0][index] for name, index in zip(axes, at, strict=True))
        raise InputError(
            f'{path}: has {counts.max()} values at time {time:g}, x {x:g}, z {z:g}; remove all '
            'but one'
        )


def _netcdf(path: Path) -> _Arrays:
    """Return the maps of a NetCDF file or a zarr folder, which the same library reads."""
    if (path / 'zarr.json').is_file():
        raise InputError(f'{path}: is zarr of version 3; write it with zarr_format=2, or as NetCDF')
    address = zarr_address(path, 'zarr,file') if path.is_dir() else ''
    try:
        with contextlib.closing(netCDF4.Dataset(address or regular(path))) as dataset:
            dataset.set_auto_mask(not path.is_dir())  # zarr fills with 0, which is no gap
            names = {q: _chosen(path, list(dataset.variables), q) for q in NAMES}
            maps = dataset.variables[str(names['concentration'])]
            dimensions = _dimensions(path, maps)
            order = [_axis(path, dimensions, quantity) for quantity in ('time', 'z', 'x')]
            found = {q: dataset.variables[name] for q, name in names.items() if name}
            for each in found.values():
                check_variable(path, each)
            units = {q: str(getattr(each, 'units', '')).lower() for q, each in found.items()}
            return _Arrays(
                np.transpose(_without_gaps(maps[:]), order),
                np.asarray(found['time'][:]),
                np.asarray(found['x'][:]) if 'x' in found else None,
                np.asarray(found['z'][:]) if 'z' in found else None,
                units,
                downward=str(getattr(found.get('z'), 'positive', '')).strip().lower() == 'down',
            )
    except (OSError, RuntimeError) as error:
        raise InputError(f'{path}: cannot be read ({error}); write NetCDF or zarr v2') from None


def _without_gaps(values: NDArray[Any]) -> NDArray[Any]:
    """Return `values` with NaN for what is masked."""
    if not np.ma.is_masked(values):
        return np.asarray(values)
    return np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan)


def _dimensions(path: Path, variable: Any) -> list[str]:
    """Return the names of a variable's dimensions; in zarr an attribute of xarray holds them."""
    named = getattr(variable, '_ARRAY_DIMENSIONS', None)
    names = list(variable.dimensions) if named is None else list(np.atleast_1d(named))
    if len(names) != 3:
        raise InputError(f'{path}: {variable.name} has {len(names)} dimensions; needs time, z, x')
    return [str(name).strip() for name in names]


def _axis(path: Path, dimensions: list[str], quantity: str) -> int:
    for wanted in NAMES[quantity]:
        if wanted in dimensions:
            return dimensions.index(wanted)
    raise InputError(f'{path}: its dimensions are {", ".join(dimensions)}; needs {quantity}')
