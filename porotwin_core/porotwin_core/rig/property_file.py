"""Maps of the rig in NetCDF files: a variable (z, x), row 0 lowest."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.netcdf_file import open_netcdf
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig.sections import MapReference

if TYPE_CHECKING:
    import netCDF4

EDGE_TOLERANCE = 0.02
"""Part of the rig by which cell centres may lie beyond it: round-off and cells at the edge."""


def read_property(path: Path, quantity: str, reference: MapReference) -> FloatArray:
    """Return the map (nz, nx) of a property that the description at `path` refers to.

    Raises:
        InputError: it cannot be read, or has values that are not positive.
    """
    file = path.parent / reference.file
    if not file.is_file():
        raise InputError(f"{path}: {quantity} names '{reference.file}', which is not beside it")
    values = read_map(file, reference.variable, quantity)
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise InputError(f'{file}: {reference.variable} must be finite and positive everywhere')
    return values


def read_map(
    file: Path, variable: str, quantity: str, size: tuple[float, float] | None = None
) -> FloatArray:
    """Return the map (nz, nx) in a NetCDF `file`, NaN where it is masked.

    Args:
        file: the file.
        variable: name of the map in it.
        quantity: key of rig.yaml, for messages.
        size: width and height of the rig [m] that the axes of the file must fit; None: any.

    Raises:
        InputError: it cannot be read, or its axes are wrong.
    """
    try:
        with open_netcdf(file) as dataset:
            _check_axes(file, dataset, variable, size)
            check_variable(file, dataset.variables[variable])
            values: FloatArray = np.ma.filled(
                np.ma.asarray(dataset.variables[variable][:], dtype=float), np.nan
            )
    except KeyError:
        raise InputError(f"{file}: has no variable '{variable}' for {quantity}") from None
    except InputError:
        raise
    except (OSError, RuntimeError, ValueError) as error:  # damaged, or no numbers
        raise InputError(
            f'{file}: not a readable NetCDF file with numbers ({error}); write it again'
        ) from None
    if values.ndim != 2:
        raise InputError(f'{file}: {variable} has {values.ndim} dimensions, needs (z, x)')
    return values


def check_variable(file: Path, variable: 'netCDF4.Variable', at_once: int | None = None) -> None:
    """Check the claimed size of a variable, in double precision, and of its chunks.

    Args:
        file: the file, for the message.
        variable: of a NetCDF file or a zarr folder.
        at_once: values along the first dimension that are read at once; None: all.

    Raises:
        InputError: it claims more than is read at once.
    """
    shape = variable.shape if at_once is None else (at_once, *variable.shape[1:])
    chunks = variable.chunking()
    for sizes in (shape, chunks if isinstance(chunks, list) else ()):
        check_declared(f'{file}: {variable.name}', (*sizes, np.float64().itemsize))


def _check_axes(
    file: Path, dataset: 'netCDF4.Dataset', variable: str, size: tuple[float, float] | None
) -> None:
    """Check the axes of a map as far as the file names them.

    Raises:
        InputError: the axes are exchanged or run backward, or leave a rig of `size` [m].
    """
    names = dataset.variables[variable].dimensions
    if names == ('x', 'z'):
        raise InputError(f'{file}: {variable} has the dimensions (x, z); transpose it to (z, x)')
    lengths = dict(zip(('x', 'z'), size or (), strict=False))
    for name in names:
        axis = dataset.variables.get(name)
        if axis is None or axis.ndim != 1 or len(axis) < 2:
            continue
        first, last = float(axis[0]), float(axis[-1])
        if last < first:
            raise InputError(
                f'{file}: {name} decreases; row 0 is the lowest, column 0 the leftmost'
            )
        length = lengths.get(name)
        cell = (last - first) / (len(axis) - 1)
        if length is not None and (
            max(abs(first - cell / 2), abs(last + cell / 2 - length)) > EDGE_TOLERANCE * length
        ):
            raise InputError(
                f'{file}: {name} runs from {first:.4g} to {last:.4g} m and the rig from 0 to '
                f'{length:g} m; the map must cover the whole rig, with cell centres in metres'
            )


def write_map(file: Path, variable: str, values: FloatArray, grid: Grid) -> None:
    """Write a map (nz, nx) on `grid` to a NetCDF `file`."""
    import netCDF4

    with netCDF4.Dataset(file, 'w') as dataset:
        for name, coordinate in (('z', grid.z), ('x', grid.x)):
            dataset.createDimension(name, len(coordinate))
            dataset.createVariable(name, 'f8', (name,))[:] = coordinate
            dataset[name].units = 'm'
        dataset.createVariable(variable, 'f8', ('z', 'x'))[:] = values
