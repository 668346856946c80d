"""Writes a recording for notebooks: one NetCDF file or one zarr folder with CF attributes.

`xarray.open_dataset` and `xarray.open_zarr` open them. The NetCDF library writes both, so that
zarr is no dependency of ours. It writes zarr of version 2, which every zarr reads.

Conventions: https://cfconventions.org; the folder: https://zarr-specs.readthedocs.io (v2).
"""

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import netCDF4
import numpy as np
from numpy.typing import NDArray

from porotwin_core import PROGRAM
from porotwin_core.errors import InputError
from porotwin_core.units import to_ml_h
from porotwin_recording.recording import Recording

Format = Literal['zarr', 'netcdf']

CONVENTIONS = 'CF-1.11'
ZARR_METADATA = ('.zgroup', '.zattrs', '.zarray')
CONSOLIDATED = '.zmetadata'

_FIELDS = {
    'concentration': ('tracer concentration, 1 = stock, NaN = not seen', '1'),
    'deviation': ('standard deviation of the concentration', '1'),
    'systematic': ('part of the standard deviation that is the same at all times', '1'),
}

Progress = Callable[[int, int], None]
"""Receives the number of finished maps, and their total."""


def export_dataset(
    recording: Recording, target: Path, kind: Format, *, progress: Progress | None = None
) -> None:
    """Write maps, rates and rig of a recording; `target` appears when it is complete.

    The dataset has the dimensions `time`, `z`, `x` and `well`. Rates stand at the times of the
    maps, as they were commanded. One map is in memory at a time.

    Args:
        recording: the recording.
        target: the NetCDF file or the zarr folder.
        kind: which of them.
        progress: receives the progress.

    Raises:
        InputError: `target` exists or cannot be written, or the recording holds no maps.
    """
    if target.exists():
        raise InputError(f'{target}: exists already; name another or remove it')
    times = recording.times
    partial = target.with_name(f'.{target.name}.partial')
    _remove(partial)
    address = f'file://{partial.resolve()}#mode=zarr,xarray,file' if kind == 'zarr' else partial
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.closing(netCDF4.Dataset(str(address), 'w')) as dataset:
            _define(dataset, recording, kind)
            for number, values in enumerate(_maps(recording)):
                for name, field in values.items():
                    dataset.variables[name][number] = field
                if progress is not None:
                    progress(number + 1, len(times))
        if kind == 'zarr':
            _complete_zarr(partial)
        partial.rename(target)
    except (OSError, RuntimeError) as error:
        raise InputError(f'{target}: cannot be written ({error})') from None
    finally:
        _remove(partial)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def _maps(recording: Recording) -> Iterator[dict[str, NDArray[np.float32]]]:
    """Yield the maps of every time by the name of their variable."""
    assert recording.maps is not None
    for fields in recording.maps.with_deviations():
        named = zip(_FIELDS, fields, strict=True)
        yield {name: field for name, field in named if field is not None}


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
