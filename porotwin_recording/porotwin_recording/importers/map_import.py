"""Maps of other programs as an experiment folder: npz, CSV, NetCDF, zarr, MATLAB and TIFF stacks.

- npz: an array of three dimensions (time, row, column) and one of times; `x` and `z` if known.
- CSV: columns time, x, z and concentration, one line for each value, in any order.
- NetCDF, zarr (version 2 or 3): dimensions time, z or y, x, in any order, with coordinates.
- MATLAB: as npz, but (row, column, time).
- TIFF: a stack with the interval of ImageJ.
"""

import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import cftime
import numpy as np
from numpy.typing import NDArray

from porotwin_checks.checks.map_values import MOST_STOCK
from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.text_with_unit import PERCENT
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.rig import Rig
from porotwin_core.rig.rig_file import names_file
from porotwin_recording.experiment.experiment_folder import FILES, RIG_FILE, write_folder
from porotwin_recording.importers.foreign_arrays import ARRAY_FILES, NamedArray, named_arrays
from porotwin_recording.importers.foreign_table import Decimal, read_foreign_table
from porotwin_recording.importers.foreign_time import moments
from porotwin_recording.importers.foreign_units import (
    length_factor,
    plain_unit,
    share_factor,
    time_factor,
    unit_in,
)
from porotwin_recording.importers.open_question import QuestionError, settled
from porotwin_recording.importers.protocol_photographs import visible
from porotwin_recording.importers.words_of_languages import NAMES as ALL_NAMES
from porotwin_recording.importers.words_of_languages import plain
from porotwin_recording.mcap.bag_folder import is_bag
from porotwin_recording.tables.cf_values import unpacked
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.no_value import LEAST_NOISE, Counts, in_words, without_codes
from porotwin_recording.tables.recorded_data import RecordedData

SUFFIXES = (*ARRAY_FILES, '.csv')
FirstRow = Literal['top', 'bottom']

NAMES = {quantity: ALL_NAMES[quantity] for quantity in ('concentration', 'time', 'x', 'z')}
"""Names of quantities, the surest first."""


FAR_FROM_SQUARE, NEARLY_SQUARE = 1.3, 1.1
"""Longer over shorter side of a cell: maps are taken as transposed if they have cells beyond the
first, and transposed ones below the second."""

FARTHEST_CENTRE = 0.49
"""Largest distance from a coordinate to the centre of its cell, in cells: edges of cells are half a
cell off, and round-off must not decide about them."""

LONG_AFTER = 10.0
"""Time from a reference date to the first map, in lengths of the recording, above which the date is
no begin of an experiment."""

TEXT_KINDS = 'SUO'
"""Kinds of arrays that hold texts."""

REAL_KINDS = 'biuf'
"""Kinds of arrays that hold real numbers: truth values, integers and floats."""

NO_NUMBERS = ('nan', 'na', 'n/a', '#n/a', '#nv', 'null', 'none', '-', '--', 'inf', '1.#qnan')
"""Words for no value in tables, in small letters."""


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
        no_value: number that stands for no value.
    """

    time_unit: str = ''
    first_row: FirstRow | None = None
    stock: float | None = None
    decimal: Decimal | None = None
    no_value: float | None = None


@dataclass(frozen=True)
class _Arrays:
    """Arrays of a file: values (time, row, column), times, coordinates, and units by name.

    `calendar`: of the times. `downward`: z counts from the top of the rig down. `gaps`: numbers of
    values that the file calls missing.
    """

    values: NDArray[Any]
    times: NDArray[Any]
    x: NDArray[Any] | None
    z: NDArray[Any] | None
    units: dict[str, str]
    calendar: str = 'standard'
    downward: bool = False
    gaps: Mapping[str, int] = field(default_factory=dict)


def maps_in(folder: Path) -> Path:
    """Return the only file of maps in and below `folder`, which holds no experiment.

    The folder itself if it holds no maps, or other data beside them; a file as it is.

    Raises:
        InputError: it holds several.
    """
    experiment = any((folder / name).exists() for name in FILES if name != RIG_FILE)
    if not folder.is_dir() or folder.suffix.lower() in SUFFIXES or experiment or is_bag(folder):
        return folder
    found = sorted(
        one
        for one in visible(folder)
        if one.suffix.lower() in SUFFIXES and not names_file(folder / RIG_FILE, one)
    )
    if len(found) > 1:
        raise InputError(
            f'{folder}: holds {len(found)} files of maps, such as {found[0].relative_to(folder)} '
            f'and {found[1].relative_to(folder)}; name one of them, or keep it alone'
        )
    return found[0] if found else folder


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
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f'{path}: no file of maps; give one that ends in {", ".join(SUFFIXES)}')

    @functools.cache
    def arrays(decimal: Decimal | None) -> _Arrays:
        return _csv(path, decimal) if suffix == '.csv' else _read_arrays(path)

    read = settled(lambda tried: _read(path, arrays(tried.decimal), rig, tried), answers)
    write_folder(target, RecordedData(rig, maps=read.maps))
    return read.told


class _ReadMaps(NamedTuple):
    """The maps of a file, and the assumptions made."""

    maps: ConcentrationMaps
    told: list[str]

    @property
    def in_words(self) -> str:
        """The times of the maps and their largest value."""
        times, values = self.maps.times, self.maps[:]
        seen = values[values > 0.0]
        if not seen.size:
            return f'{len(times)} maps from {times[0]:.6g} to {times[-1]:.6g} s, nothing above 0'
        heights = np.broadcast_to(self.maps.grid.z[:, None], values.shape)[values > 0.0]
        height = np.average(heights, weights=seen)
        shares = f'median above 0 {np.median(seen):.2g}, largest {seen.max():.3g}'
        return (
            f'{len(times)} maps from {times[0]:.6g} to {times[-1]:.6g} s, '
            f'{shares}, its middle at z {height:.3g} m'
        )

    @property
    def is_apart(self) -> bool:
        """Maps alone meet themselves."""
        return False


def _read(path: Path, arrays: _Arrays, rig: Rig, answers: MapAnswers) -> _ReadMaps:
    """Return the maps that the arrays hold with the `answers`.

    Raises:
        InputError: as `import_maps`.
        QuestionError: other answers may mend it.
    """
    if answers.stock is not None and not 0.0 < answers.stock < np.inf:
        raise InputError(f'--stock {answers.stock:g}: give a finite number above 0, such as 100')
    told: list[str] = []
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
    if values.dtype == np.float16:
        values = values.astype(np.float32)
    values, gaps = _without_gaps(path, values, arrays, answers)
    if gaps:
        told.append(f'{path}: {in_words(gaps, values.size)}')
    values = _shares(path, values, arrays.units.get('concentration', ''), answers, told)
    _check_extent(path, arrays, rig)
    grid = rig.grid(values.shape[2], values.shape[1])
    maps = ConcentrationMaps(times, grid, lambda first, last: values[first:last])
    told.append(f'{path}: {len(times)} maps of {grid} cells, which cover the whole rig')
    return _ReadMaps(maps, told)


def _without_gaps(
    path: Path, values: NDArray[Any], arrays: _Arrays, answers: MapAnswers
) -> tuple[NDArray[Any], Counts]:
    """Return the values with NaN for every number that means none, and their counts.

    Raises:
        InputError: values are no real numbers, or infinite.
    """
    if values.dtype.kind not in REAL_KINDS:
        raise InputError(f'{path}: its maps are of the type {values.dtype}; write real numbers')
    gaps = dict(arrays.gaps)
    if answers.no_value is not None:
        found = values == values.dtype.type(answers.no_value)
        if not found.any():
            raise InputError(
                f'--no-value {answers.no_value:g}: {path} does not hold it; correct it'
            )
        gaps[f'{answers.no_value:g} (--no-value)'] = int(found.sum())
        values = np.where(found, np.nan, values)
    infinite = int(np.isinf(values).sum())
    if infinite:
        raise InputError(
            f'{path}: {infinite} values of its maps are infinite; write NaN where there is no value'
        )
    values, codes = without_codes(values, answers.stock or 1.0)
    return values, {**gaps, **codes}


def _seconds(
    path: Path, arrays: _Arrays, answers: MapAnswers, told: list[str]
) -> NDArray[np.float64]:
    """Return the times [s] from the first one on, or from zero if they begin later."""
    times = _dates(path, arrays.times, told)
    if times.ndim != 1 or times.dtype.kind not in f'{REAL_KINDS}Mm':
        raise InputError(
            f'{path}: its times are no row of numbers; write numbers, datetime64 or dates as text'
        )
    if times.dtype.kind == 'M':
        shown = np.datetime_as_string(times, unit='s').tolist()
        seconds = _dated_seconds(times)
        _check_rise(path, seconds, shown)
        told.append(f'{path}: time zero is {shown[0]}, its first map')
    elif times.dtype.kind == 'm':
        if np.datetime_data(times.dtype)[0] in ('Y', 'M'):
            raise InputError(f'{path}: years and months have no one length; write times in seconds')
        seconds = times / np.timedelta64(1, 's')
        _check_rise(path, seconds, [str(time) for time in times])
    else:
        unit, epoch = _unit_of_times(path, arrays, answers)
        seconds = _counted_seconds(path, times, unit, epoch, arrays.calendar)
        shown = [f'{time:.10g}' for time in times]
        _check_rise(path, seconds, shown)
        told.append(f'{path}: times in {unit}')
        if epoch:
            seconds = _told_epoch(path, seconds, f'{shown[0]} {unit}', epoch, told)
    _check_duration(path, seconds)
    return seconds


def _dates(path: Path, times: NDArray[Any], told: list[str]) -> NDArray[Any]:
    """Return times that are texts as dates; others as they are.

    Raises:
        InputError: a text is no date, or can be read in two ways.
    """
    if times.dtype.kind not in TEXT_KINDS:
        return times
    rows = times.reshape(len(times), -1).tolist()  # perhaps with a letter in each cell
    joined = [b''.join(row) if times.dtype.kind == 'S' else ''.join(map(str, row)) for row in rows]
    words = [one.decode(errors='replace') if isinstance(one, bytes) else one for one in joined]
    words = [word.strip(' \0') for word in words]
    places = [f'{path}: the time of map {at}' for at in range(1, len(words) + 1)]
    try:
        found, assumed = moments(words, f'{path}: time', places=places)
    except QuestionError as question:  # maps have no such answers
        raise InputError(str(question)) from None
    told += [f'{path}: {line}' for line in assumed]
    return np.array([one.replace(tzinfo=None) for one in found], dtype='datetime64[us]')


def _unit_of_times(path: Path, arrays: _Arrays, answers: MapAnswers) -> tuple[str, str]:
    """Return the unit of the times, and the date since which they count, '' for none.

    Raises:
        QuestionError: the file has no unit.
        InputError: a person gives another unit than the file.
    """
    unit, _, epoch = arrays.units.get('time', '').partition(' since ')
    given = answers.time_unit
    if not unit and not given:
        raise QuestionError(
            f'{path}: time has no unit',
            [{'time_unit': each} for each in ('ms', 's', 'min', 'h', 'd')],
            'write the unit of the times into the file',
        )
    if unit and given and plain_unit(unit) != plain_unit(given):
        where = f'{path}: time'
        if time_factor(given, '--time-unit') != time_factor(unit, where):
            raise InputError(
                f"{where} is in '{unit}' by the file, and --time-unit says {given}; leave "
                '--time-unit out, or correct the file'
            )
    return unit or given, epoch


def _counted_seconds(
    path: Path, times: NDArray[Any], unit: str, epoch: str, calendar: str
) -> NDArray[np.float64]:
    """Return times that count a unit, in seconds; a month has a length in some calendars only.

    Raises:
        InputError: the unit is none of time, or has no one length.
    """
    try:
        return np.asarray(times, dtype=float) * time_factor(unit, f'{path}: time')
    except InputError as error:
        words = f'{unit} since {epoch or "2000-01-01"}'
        try:
            dates = cftime.num2date(np.asarray(times, dtype=float), words, calendar)
            begin = cftime.num2date(0.0, words, calendar)
            return np.array([(date - begin).total_seconds() for date in dates])
        except (ValueError, TypeError, OverflowError):
            raise InputError(
                f'{error}; write the times in days or shorter units, as CF does'
            ) from None


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
        raise QuestionError(
            f'{path}: nothing says whether the first row of a map is at the top, as in a picture',
            [{'first_row': 'top'}, {'first_row': 'bottom'}],
            'write z of the rows',
        )
    told.append(f'{path}: the first row of a map is at the {answers.first_row}')
    return arrays.values if answers.first_row == 'bottom' else arrays.values[:, ::-1]


def _shares(
    path: Path, values: NDArray[Any], unit: str, answers: MapAnswers, told: list[str]
) -> NDArray[np.float32]:
    """Return the maps, whose file states `unit`, as shares of the tracer stock.

    Raises:
        InputError: no value is above 0.
        QuestionError: the values are in another unit, and nothing says which value is the stock.
    """
    if np.isnan(values).all():
        raise InputError(f'{path}: all values of its maps are missing')
    floats = np.asarray(values, dtype=np.float32)
    least, largest = float(np.nanmin(floats)), float(np.nanmax(floats))
    if largest <= 0.0 and least < 0.0:
        raise InputError(
            f'{path}: concentrations lie between {least:.3g} and {largest:.3g}, none is above 0; '
            'correct their sign: 0 is water, 1 is tracer stock'
        )
    if least < -LEAST_NOISE * (answers.stock or 1.0):
        told.append(f'{path}: concentrations go down to {least:.3g}, although 0 is water')
    stock = answers.stock
    if stock is None and _is_percent(unit) and MOST_STOCK < largest <= MOST_STOCK * PERCENT:
        stock = PERCENT
    if stock is None:
        _ask_for_stock(path, values, unit, largest)
        return floats
    told.append(f'{path}: {stock:g} is tracer stock')
    return floats / np.float32(stock)


def _ask_for_stock(path: Path, values: NDArray[Any], unit: str, largest: float) -> None:
    """Check that the values are shares of the tracer stock, as far as unit and size show.

    Raises:
        QuestionError: they are not.
    """
    if _is_percent(unit) and largest <= MOST_STOCK:
        raise QuestionError(
            f"{path}: concentrations are in '{unit}', but reach only {largest:.3g}",
            [{'stock': PERCENT}, {'stock': 1.0}],
            'correct the unit',
        )
    if AMOUNTS.match(unit):
        raise QuestionError(
            f"{path}: concentrations are in '{unit}' and reach {largest:.3g}",
            [],
            'give --stock, the value of the tracer stock in this unit',
        )
    if largest <= MOST_STOCK:
        return
    exact = float(np.nanmax(values))
    rest = values[values < exact]
    ways = [{'stock': PERCENT if largest <= MOST_STOCK * PERCENT else exact}]
    if (values == exact).sum() > 1 and rest.size and rest.max() <= MOST_STOCK:
        ways.append({'no_value': exact})  # a number that stands alone, far above all others
    raise QuestionError(
        f'{path}: concentrations reach {exact:.6g}, and 1 is tracer stock',
        ways,
        'give --stock, the value of the tracer stock',
    )


def _is_percent(unit: str) -> bool:
    try:
        return share_factor(unit, '') < 1.0
    except InputError:
        return False


def _check_extent(path: Path, arrays: _Arrays, rig: Rig) -> None:
    """Compare the coordinates with the size of the rig.

    Raises:
        InputError: the maps do not cover the rig.
    """
    for name, values, size in (('x', arrays.x, rig.width_m), ('z', arrays.z, rig.height_m)):
        if values is None or len(values) < 2:
            continue
        factor = length_factor(arrays.units.get(name, ''), f'{path}: {name}')
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


def _chosen(path: Path, found: Mapping[str, NamedArray], quantity: str) -> str | None:
    """Return the name of the array of a quantity: by its name, attributes, or as the only one.

    Units at the end of a name do not count.

    Raises:
        InputError: several arrays have equally sure names, or a needed one is missing.
    """
    for wanted in NAMES[quantity]:
        for name in found:
            if plain(name) == wanted:
                return name
        begun = [name for name in found if re.split(r'[_\s\[(]', plain(name))[0] == wanted]
        if len(begun) > 1:
            raise InputError(
                f'{path}: which {quantity} is meant, {begun[0]} or {begun[1]}? name it {wanted}'
            )
        if begun:
            return begun[0]
    others = [name for name, array in found.items() if _is_of(array, quantity)]
    if len(others) == 1:
        return others[0]
    if quantity in ('concentration', 'time'):
        raise InputError(f'{path}: has no {quantity}; it holds {", ".join(found) or "no array"}')
    return None


def _is_of(array: NamedArray, quantity: str) -> bool:
    """Return whether an array is of a quantity by its attributes and its shape."""
    if quantity == 'concentration':
        return len(array.shape) == 3
    axis = str(array.attributes.get('axis', '')).upper()
    units = str(array.attributes.get('units', ''))
    return len(array.shape) == 1 and (
        (axis in {'time': 'T', 'x': 'X', 'z': 'YZ'}[quantity] * bool(axis) and bool(axis))
        or (quantity == 'time' and ' since ' in units)
    )


def _read_arrays(path: Path) -> _Arrays:
    """Return the arrays of a file, unpacked, with the time first and the row second."""
    with named_arrays(path) as found:
        names = {quantity: _chosen(path, found, quantity) for quantity in NAMES}
        known = {quantity: found[name] for quantity, name in names.items() if name}
        units = {
            quantity: plain_spaces(each.attributes.get('units')) or unit_in(str(names[quantity]))
            for quantity, each in known.items()
        }
        maps = known['concentration']
        values, gaps = unpacked(maps.read(), maps.attributes)
        if maps.dimensions:
            values = np.transpose(values, _order(path, str(names['concentration']), maps, names))
        axes = {
            quantity: unpacked(np.atleast_1d(each.read()), each.attributes)[0]
            for quantity, each in known.items()
            if quantity != 'concentration'
        }
        z = known.get('z')
        return _Arrays(
            values,
            axes['time'],
            axes.get('x'),
            axes.get('z'),
            units,
            calendar=str(known['time'].attributes.get('calendar', 'standard')),
            downward=z is not None
            and str(z.attributes.get('positive', '')).strip().lower() == 'down',
            gaps=gaps,
        )


def plain_spaces(unit: object) -> str:
    """Return the unit of an attribute in small letters; '' for none."""
    return ' '.join(str('' if unit is None else unit).lower().split())


def _order(path: Path, name: str, maps: NamedArray, names: Mapping[str, str | None]) -> list[int]:
    """Return the order of axes that puts time first, then z, then x."""
    dimensions = [each.strip() for each in maps.dimensions]
    if len(dimensions) != 3:
        raise InputError(f'{path}: {name} has {len(dimensions)} dimensions; needs time, z, x')
    order = []
    for quantity in ('time', 'z', 'x'):
        wanted = (names[quantity], *NAMES[quantity])
        at = next((dimensions.index(each) for each in wanted if each in dimensions), None)
        if at is None:
            raise InputError(
                f'{path}: its dimensions are {", ".join(dimensions)}; needs {quantity}'
            )
        order.append(at)
    return order


def _csv(path: Path, decimal: Decimal | None) -> _Arrays:
    """Return the maps of a long table; a value that is empty or not there is missing (NaN)."""
    table = read_foreign_table(path, decimal)
    titles = {quantity: table.needed(quantity) for quantity in NAMES}
    title = titles['concentration']
    words = ['' if plain(word) in NO_NUMBERS else word for word in table.columns[title]]
    seen = [bool(word) for word in words]
    table = replace(table, columns={**table.columns, title: words})
    needed = {quantity: seen if quantity == 'concentration' else () for quantity in NAMES}
    dated = not unit_in(titles['time']) and not table.is_number(titles['time'])
    columns = {
        q: np.array(
            table.columns[titles[q]]
            if dated and q == 'time'
            else table.numbers(titles[q], needed[q])
        )
        for q in NAMES
    }
    axes = {name: np.unique(columns[name], return_inverse=True) for name in ('time', 'z', 'x')}
    check_declared(path, (*(len(axes[name][0]) for name in axes), np.float32().itemsize))
    values = np.full([len(axes[name][0]) for name in axes], np.nan)
    places = tuple(axes[name][1] for name in axes)
    _refuse_repeated(path, axes, places)
    values[places] = np.where(seen, columns['concentration'], np.nan)
    units = {name: unit_in(title) for name, title in titles.items()}
    counts = {'no line': values.size - table.length, 'no number': seen.count(False)}
    gaps = {why: count for why, count in counts.items() if count}
    return _Arrays(values, axes['time'][0], axes['x'][0], axes['z'][0], units, gaps=gaps)


def _shown(time: Any) -> str:
    return time if isinstance(time, str) else f'{time:g}'


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
            f'{path}: has {counts.max()} values at time {_shown(time)}, x {x:g}, z {z:g}; remove '
            'all but one'
        )
