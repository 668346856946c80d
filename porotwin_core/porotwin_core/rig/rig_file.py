"""Reading and writing `rig.yaml` and the NetCDF maps beside it."""

from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pydantic
import yaml

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.rig.complaints import one_line
from porotwin_core.rig.description import PROPERTIES, Rig
from porotwin_core.rig.sections import MapReference

FILE_NAME = 'rig.yaml'
"""Name of the description in a folder."""


def load_rig(path: Path | str) -> Rig:
    """Return the rig described by the file `path`, or by `rig.yaml` in the folder `path`.

    Raises:
        InputError: one line with the file, the key and the remedy.
    """
    path = Path(path)
    if path.is_dir():
        path = path / FILE_NAME
    try:
        data = yaml.safe_load(path.read_text(encoding='utf-8'))
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; name a rig.yaml or a folder with one') from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f'{path}: not readable as YAML: {" ".join(str(error).split())}') from None
    return parse_rig(data, path)


def parse_rig(data: Any, path: Path) -> Rig:
    """Return the rig described by `data`, the content of the file `path`.

    Map files are looked for beside `path`; the file itself need not exist.

    Raises:
        InputError: one line with the file, the key and the remedy.
    """
    if not isinstance(data, dict):
        raise InputError(f'{path}: not a rig description; expected keys such as name and width_m')
    try:
        rig = Rig.model_validate(data)
    except pydantic.ValidationError as error:
        raise InputError(one_line(path, error)) from None
    maps: dict[str, FloatArray] = {}
    for name in PROPERTIES:
        value = getattr(rig, name)
        if isinstance(value, MapReference):
            maps[name] = _read_map(path, name, value)
    return rig.with_maps(maps)


def rig_from_maps(data: dict[str, Any], quantities: dict[str, float | FloatArray]) -> Rig:
    """Return the rig of `data` with properties given as numbers or arrays instead of files.

    Args:
        data: the keys of `rig.yaml` other than `quantities`.
        quantities: depth_m [m], porosity [-], permeability_m2 [m^2]; numbers or maps (nz, nx).
            A map is named after its property, also the file that `write_rig` puts it in.

    Raises:
        InputError: one line with the key, the value and the remedy.
    """
    maps = {name: value for name, value in quantities.items() if not isinstance(value, float)}
    references = {name: MapReference(file=f'{name}.nc', variable=name) for name in maps}
    try:
        rig = Rig.model_validate({**data, **quantities, **references})
    except pydantic.ValidationError as error:
        raise InputError(one_line('rig description', error)) from None
    return rig.with_maps(maps)


def write_rig(rig: Rig, path: Path | str) -> None:
    """Write `rig` to the file `path`, and its maps as NetCDF files beside it.

    Every map has a file of its own, with the name that `rig` refers to, without folders. If two
    maps were in one file, the second is named after its property.
    """
    path = Path(path)
    data = rig.model_dump(mode='json', exclude_defaults=True)
    used: set[str] = set()
    for quantity, values in rig.nominal_maps.items():
        reference = getattr(rig, quantity)
        name = Path(reference.file).name
        name = f'{quantity}.nc' if name in used else name
        used.add(name)
        data[quantity]['file'] = name
        _write_map(path.parent / name, reference.variable, values, rig)
    path.write_text(
        yaml.safe_dump(data, sort_keys=False, default_flow_style=None), encoding='utf-8'
    )


def _read_map(path: Path, quantity: str, reference: MapReference) -> FloatArray:
    file = path.parent / reference.file
    if not file.is_file():
        raise InputError(f"{path}: {quantity} names '{reference.file}', which is not beside it")
    try:
        with netCDF4.Dataset(file) as dataset:
            values: FloatArray = np.ma.filled(
                np.ma.asarray(dataset.variables[reference.variable][:], dtype=float), np.nan
            )
    except KeyError:
        raise InputError(f"{file}: has no variable '{reference.variable}' for {quantity}") from None
    except OSError as error:
        raise InputError(f'{file}: not a readable NetCDF file ({error})') from None
    if values.ndim != 2:
        raise InputError(f'{file}: {reference.variable} has {values.ndim} dimensions, needs (z, x)')
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise InputError(f'{file}: {reference.variable} must be finite and positive everywhere')
    return values


def _write_map(file: Path, variable: str, values: FloatArray, rig: Rig) -> None:
    grid = rig.grid(values.shape[1], values.shape[0])
    with netCDF4.Dataset(file, 'w') as dataset:
        for name, coordinate in (('z', grid.z), ('x', grid.x)):
            dataset.createDimension(name, len(coordinate))
            dataset.createVariable(name, 'f8', (name,))[:] = coordinate
            dataset[name].units = 'm'
        dataset.createVariable(variable, 'f8', ('z', 'x'))[:] = values
