"""fields.nc: the maps behind a verdict (diagnosis contract)."""

from pathlib import Path

import netCDF4

from porotwin_core.basis.errors import write_error
from porotwin_core.basis.whole_file import whole_file
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_diagnosis.decision.held_out import HeldOut


def write_fields(path: Path, grid: Grid, gap: FloatArray, held_out: HeldOut) -> None:
    """Write the maps of one recording on its `grid` as NetCDF.

    - `gap` (z, x) [1/s]: where the gap arises;
    - `remainder` (z, x): root mean square over the held-out times of predicted after - observed;
    - `observed`, `predicted_before`, `predicted_after` (time, z, x): held-out maps, relative to
      the tracer stock.

    The file gets its name when it is complete.

    Raises:
        OSError: the disk is full or fails.
    """
    with whole_file(path) as unfinished:
        try:
            _write(unfinished, grid, gap, held_out)
        except (OSError, RuntimeError) as error:
            raise write_error(path, error) from None  # before the removal makes room again


def _write(path: Path, grid: Grid, gap: FloatArray, held_out: HeldOut) -> None:
    with netCDF4.Dataset(path, 'w') as dataset:
        axes = {'time': held_out.times, 'z': grid.z, 'x': grid.x}
        for name, values in axes.items():
            dataset.createDimension(name, len(values))
            dataset.createVariable(name, 'f8', (name,))[:] = values
            dataset[name].units = 's' if name == 'time' else 'm'
        maps = {
            'gap': gap,
            'remainder': held_out.remainder,
            'observed': held_out.observed,
            'predicted_before': held_out.before,
            'predicted_after': held_out.after,
        }
        for name, values in maps.items():
            shape = ('time', 'z', 'x')[3 - values.ndim :]
            dataset.createVariable(name, 'f4', shape, zlib=True)[:] = values
            dataset[name].units = '1/s' if name == 'gap' else '1'
