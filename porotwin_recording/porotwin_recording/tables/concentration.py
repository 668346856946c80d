"""Tracer maps of an experiment folder: `concentration.nc`, read and written map by map."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path
from typing import Any, Final, Self, overload

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.netcdf_file import open_netcdf
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.property_file import check_variable
from porotwin_recording.tables.cf_values import (
    has_range,
    netcdf_attributes,
    unpacked,
)
from porotwin_recording.tables.map_writer import MapWriter
from porotwin_recording.tables.no_value import Counts, in_words, without_codes

Maps = NDArray[np.float32]

LOG = logging.getLogger('porotwin')
"""Receives a warning for odd values; commands and nodes show it."""

CELL_TOLERANCE = 0.05
"""Largest accepted distance between a cell centre and the rig's grid, as a fraction of a cell."""

PACKED_STEP = 0.004
"""Resolution of packed maps [-]. The codes 0 to 254 cover 0 to 1.016."""

PACKED_NAN = 255
"""Code of NaN in packed maps."""

DEVIATIONS = {
    'deviation': 'standard deviation of the concentration',
    'systematic': 'part of the standard deviation that is the same at all times',
}
"""Variables of standard deviations, with their descriptions."""

_COORDINATE_UNITS = {
    's': {'', '1', '-', 's', 'sec', 'secs', 'second', 'seconds'},
    'm': {'', '1', '-', 'm', 'meter', 'meters', 'metre', 'metres'},
}
"""Words in files for the unit of a coordinate; files without a unit are taken at their word."""

_NO_UNIT = {'', '1', '1.0', '-', 'none', 'dimensionless', 'unitless', 'fraction'}
"""Words in files for a number without a unit."""


MAPS_AT_ONCE = 16
"""Maps in memory at once, 14 MB at 750 x 300 cells, and in a part of a file being written: a kill
costs at most so many."""

VIRTUAL: Final = 'virtual rig'
"""Last words of the program of maps that the virtual rig made, or whose photographs it took."""


def is_of_virtual_rig(program: str) -> bool:
    """Return whether a `program`, as a file names it, is the virtual rig."""
    return program.endswith(VIRTUAL)


@dataclass(frozen=True)
class MapOrigin:
    """How maps were made.

    Attributes:
        calibrated: whether their scale was measured; None: not known.
        calibration: SHA-256 of the calibration's file; empty: none, or not known.
        program: name and version of the program; empty: not known.
        scale: 'relative' if the core of the plume counts as 1; empty: as `calibrated` tells.
    """

    calibrated: bool | None = None
    calibration: str = ''
    program: str = ''
    scale: str = ''

    @property
    def is_virtual(self) -> bool:
        """Whether the virtual rig made the maps, or took their photographs."""
        return is_of_virtual_rig(self.program)

    @property
    def in_words(self) -> str:
        """Who made the maps, such as "made by PoroTwin 1.0, image, without a calibration"."""
        scale = ', without a calibration' if self.calibrated is False else ''
        scale = ', on a relative scale' if self.scale else scale
        return (f'made by {self.program}' if self.program else 'of unknown origin') + scale


UNKNOWN_ORIGIN = MapOrigin()
"""Maps of a simulation, or from a file that does not say."""


@dataclass(frozen=True)
class MapSeries:
    """A series of maps that is read from disk on demand.

    An index selects one map (nz, nx), a slice a series (nt, nz, nx), both float32. NaN marks cells
    without information in the photograph. Iteration holds a few maps in memory at a time.

    Attributes:
        times: seconds since the start of the experiment, ascending, shape (nt,).
        grid: grid of the maps.
        read: returns the maps from a first index up to, not including, a last one.
    """

    times: NDArray[np.float64]
    grid: Grid
    read: Callable[[int, int], Maps]

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, index: int) -> Maps: ...
    @overload
    def __getitem__(self, index: slice) -> Maps: ...
    def __getitem__(self, index: int | slice) -> Maps:
        if isinstance(index, slice):
            start, stop, step = index.indices(len(self))
            if step == 1:
                return self.read(start, max(start, stop))
            chosen = [self[number] for number in range(start, stop, step)]  # not those between
            return np.stack(chosen) if chosen else self.read(0, 0)
        number = range(len(self))[index]
        return self.read(number, number + 1)[0]

    def __iter__(self) -> Iterator[Maps]:
        for start in range(0, len(self), MAPS_AT_ONCE):
            yield from self.read(start, min(start + MAPS_AT_ONCE, len(self)))

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> NDArray:
        maps = self[:]
        return maps if dtype is None else maps.astype(dtype)

    def part(self, first: int, stop: int) -> Self:
        """Return the maps from number `first` to before `stop`, still on disk."""
        times = self.times[first:stop]
        return replace(
            self, times=times, read=lambda begin, end: self.read(first + begin, first + end)
        )


@dataclass(frozen=True)
class ConcentrationMaps(MapSeries):
    """A series of tracer maps with their standard deviations; 1 is the tracer stock.

    Attributes:
        deviation: standard deviation of every value; None where the recording has none.
        systematic: the part of it that is the same from map to map; None likewise.
        origin: how the maps were made.
    """

    deviation: MapSeries | None = None
    systematic: MapSeries | None = None
    origin: MapOrigin = UNKNOWN_ORIGIN

    def part(self, first: int, stop: int) -> Self:
        """Return the maps from number `first` to before `stop` with their standard deviations."""
        series = {name: getattr(self, name) for name in DEVIATIONS}
        parts = {name: one and one.part(first, stop) for name, one in series.items()}
        return replace(super().part(first, stop), **parts)

    def with_deviations(self) -> Iterator[tuple[Maps, Maps | None, Maps | None]]:
        """Yield every map (nz, nx) with its `deviation` and `systematic` part, None where none."""
        nothing: Iterator[None] = repeat(None)
        deviation = nothing if self.deviation is None else self.deviation
        systematic = nothing if self.systematic is None else self.systematic
        yield from zip(self, deviation, systematic, strict=False)


def open_maps(path: Path, rig: Rig) -> ConcentrationMaps:
    """Return the maps in the NetCDF file `path` without loading them.

    Standard deviations are read if the file has them.

    Raises:
        InputError: the file is not readable, its dimensions or coordinates do not fit the grid
            over the whole `rig`, or its times do not increase, or are a year from the start.
    """
    with _damage_named(path), _dataset(path) as dataset:
        _check_maps(dataset, path, 'concentration')
        _tell_range(path, dataset.variables['concentration'])
        deviations = [name for name in DEVIATIONS if name in dataset.variables]
        for name in deviations:
            _check_maps(dataset, path, name)
        origin = _origin(dataset)
        times, z, x = (_coordinate(dataset, path, name) for name in ('time', 'z', 'x'))
    grid = rig.grid(len(x), len(z))
    _check_coordinate(path, 'x', x, grid.x, f'width_m {rig.width_m:g}')
    _check_coordinate(path, 'z', z, grid.z, f'height_m {rig.height_m:g}')
    if np.abs(times).max() > LONGEST_EXPERIMENT_S:
        worst = int(np.abs(times).argmax())
        raise InputError(
            f'{path}: time {times[worst]:.10g} s of frame {worst} is more than a year from the '
            'start; write seconds since the start of the experiment, not Unix time'
        )
    if np.any(np.diff(times) <= 0):
        first = int(np.argmax(np.diff(times) <= 0)) + 1
        raise InputError(
            f'{path}: time {times[first]:g} of frame {first} does not come after '
            f'{times[first - 1]:g}; times must increase'
        )

    series = {name: MapSeries(times, grid, _reader(path, name)) for name in deviations}
    return ConcentrationMaps(times, grid, _reader(path, 'concentration'), **series, origin=origin)


def _reader(path: Path, name: str) -> Callable[[int, int], Maps]:
    """Return the function that reads the variable `name` of the file `path`."""

    def read(start: int, stop: int) -> Maps:
        with _damage_named(path), _dataset(path) as opened:
            values, _ = _values(opened.variables[name], start, stop)
        maps = values.astype(np.float32)
        return without_impossible(maps, path) if name == 'concentration' else maps

    return read


def _values(variable: netCDF4.Variable, start: int, stop: int) -> tuple[NDArray[Any], Counts]:
    """Return the values of a variable from `start` to `stop`, and the counts of new NaN."""
    variable.set_auto_maskandscale(False)
    return unpacked(np.asarray(variable[start:stop]), netcdf_attributes(variable))


def _tell_range(path: Path, variable: netCDF4.Variable) -> None:
    """Log how many values the file itself calls invalid; few files do, and these are read once."""
    if not has_range(netcdf_attributes(variable)):
        return
    total: Counts = {}
    for start in range(0, len(variable), MAPS_AT_ONCE):
        for why, count in _values(variable, start, start + MAPS_AT_ONCE)[1].items():
            total[why] = total.get(why, 0) + count
    if total:
        LOG.warning('%s: %s', path, in_words(total, variable.size))


def without_impossible(maps: Maps, path: Path) -> Maps:
    """Return the `maps` of the recording `path` with NaN in place of impossible concentrations."""
    values, counts = without_codes(maps, stock=1.0)
    if counts:
        LOG.warning(
            '%s: in %d maps, %s; write NaN there', path, len(maps), in_words(counts, maps.size)
        )
    return np.asarray(values, dtype=np.float32)


def _check_maps(dataset: netCDF4.Dataset, path: Path, name: str) -> None:
    variable = _variable(dataset, path, name, ('time', 'z', 'x'))
    if not np.issubdtype(variable.dtype, np.number):
        raise InputError(f'{path}: {name} is {variable.dtype}; write float32')
    check_variable(path, variable, MAPS_AT_ONCE)
    unit = _unit(variable)
    if unit.lower() not in _NO_UNIT:
        stock = '100 %' if unit == '%' else f'the stock in {unit}'
        raise InputError(
            f"{path}: the units of {name} are '{unit}'; divide it by {stock} and write units '1': "
            '0 is water, 1 is tracer stock'
        )


def _unit(variable: netCDF4.Variable) -> str:
    """Return the unit of a variable, empty if it has none."""
    return ' '.join(str(getattr(variable, 'units', '')).split())


def _origin(dataset: netCDF4.Dataset) -> MapOrigin:
    """Return the origin of maps by the attributes of their file; other words count as unknown."""
    calibrated = {'yes': True, 'no': False}.get(str(getattr(dataset, 'calibrated', '')).strip())
    texts = {name: str(getattr(dataset, name, '')) for name in ('calibration', 'program')}
    texts['scale'] = str(getattr(dataset, 'map_scale', ''))
    return MapOrigin(calibrated, **texts)


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    """Turn the exceptions of the NetCDF library at damaged bytes into InputError."""
    try:
        yield
    except InputError:
        raise
    except (RuntimeError, OSError, ValueError, LookupError, AttributeError, TypeError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InputError(f'{path}: is damaged ({reason}); write it again') from None
    except MemoryError:
        raise InputError(f'{path}: claims more data than memory can hold; write it again') from None


def _dataset(path: Path) -> netCDF4.Dataset:
    try:
        return open_netcdf(path)
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; it holds the concentration maps') from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f'{path}: not a readable NetCDF file ({reason}); write it again') from None


def _variable(
    dataset: netCDF4.Dataset, path: Path, name: str, dimensions: tuple[str, ...]
) -> netCDF4.Variable:
    if name not in dataset.variables:
        raise InputError(f"{path}: has no variable '{name}' ({', '.join(dimensions)})")
    variable = dataset.variables[name]
    if variable.dimensions != dimensions:
        raise InputError(
            f'{path}: {name} has the dimensions ({", ".join(variable.dimensions)}); '
            f'needs ({", ".join(dimensions)})'
        )
    return variable


def _coordinate(dataset: netCDF4.Dataset, path: Path, name: str) -> NDArray[np.float64]:
    variable = _variable(dataset, path, name, (name,))
    unit, needed = _unit(variable), 's' if name == 'time' else 'm'
    # 'seconds since 2024-05-06' counts seconds too
    if unit.split(' since ')[0].lower() not in _COORDINATE_UNITS[needed]:
        raise InputError(f"{path}: the units of {name} are '{unit}'; write {name} in {needed}")
    check_variable(path, variable)
    filled = np.asarray(_values(variable, 0, variable.size)[0], dtype=np.float64)
    if filled.size == 0:
        raise InputError(f'{path}: {name} is empty; there is no map in it')
    if not np.isfinite(filled).all():
        raise InputError(f'{path}: {name} holds values that are not finite; give every {name}')
    return filled


def _check_coordinate(
    path: Path, name: str, found: NDArray, expected: NDArray, extent: str
) -> None:
    cell = 2 * expected[0]
    if np.abs(found - expected).max() > CELL_TOLERANCE * cell:
        raise InputError(
            f'{path}: {name} runs from {found[0]:.6g} to {found[-1]:.6g} m in {len(found)} cells, '
            f'but with {extent} in rig.yaml the cell centres run from {expected[0]:.6g} to '
            f'{expected[-1]:.6g} m; correct the one that is wrong'
        )


class ConcentrationWriter(MapWriter):
    """Writes `concentration.nc` map by map; memory use does not depend on their number.

    The file gets its name when it is complete. Values are stored as float32, bit for bit. With
    `packed` they are clipped to 0..1.016 and rounded to steps of 0.004 in 8 bits. `MapParts` writes
    the maps of a long work, which may be interrupted.

    ```
    with ConcentrationWriter(path, grid) as writer:
        writer.append(time, concentration)
    ```

    Args:
        path: the file.
        grid: the grid of the maps.
        packed: whether concentrations are packed.
        origin: how the maps were made.

    Raises:
        InputError: the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        grid: Grid,
        *,
        packed: bool = False,
        origin: MapOrigin = UNKNOWN_ORIGIN,
    ) -> None:
        super().__init__(path, grid)
        self._packed = packed
        attributes: dict[str, object] = {
            'units': '1',
            'long_name': 'tracer concentration, 1 = stock',
        }
        if packed:
            attributes |= {'scale_factor': np.float32(PACKED_STEP), 'add_offset': np.float32(0)}
        self._define(
            'concentration',
            'u1' if packed else 'f4',
            PACKED_NAN if packed else np.float32(np.nan),
            attributes,
            shuffle=not packed,
        )
        self._define_origin(origin)

    def _define_origin(self, origin: MapOrigin) -> None:
        words = {
            'calibrated': {True: 'yes', False: 'no', None: ''}[origin.calibrated],
            'calibration': origin.calibration,
            'program': origin.program,
            'map_scale': origin.scale,
        }
        self._dataset.setncatts({name: word for name, word in words.items() if word})

    def append(
        self,
        time: float,
        concentration: NDArray,
        *,
        deviation: NDArray | None = None,
        systematic: NDArray | None = None,
    ) -> None:
        """Write the map (nz, nx) [-] at `time` [s].

        Args:
            time: its time [s].
            concentration: the map (nz, nx) [-].
            deviation: its standard deviation (nz, nx) [-], if known.
            systematic: the part of it that is the same at all times, if known.

        Raises:
            InputError: the shape is not the one of the grid, or `time` does not increase.
            OSError: the disk is full or fails.
        """
        deviations = {'deviation': deviation, 'systematic': systematic}
        known = {
            name: np.asarray(values, dtype=np.float32)
            for name, values in deviations.items()
            if values is not None
        }
        self._check(time, (concentration, *known.values()))
        values = np.asarray(concentration, dtype=np.float32)
        if self._packed:
            unseen = np.isnan(values)
            values = np.clip(np.where(unseen, 0, values), 0, (PACKED_NAN - 1) * PACKED_STEP)
            values = np.ma.array(values, mask=unseen)
        for name in known:  # the first map with them makes the variable
            if name not in self._dataset.variables:
                words = {'units': '1', 'long_name': DEVIATIONS[name]}
                self._define(name, 'f4', np.float32(np.nan), words)
        self._write(time, {'concentration': values, **known})
