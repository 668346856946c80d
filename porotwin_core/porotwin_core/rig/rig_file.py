"""Reading and writing `rig.yaml` and the maps, pictures and tables beside it."""

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pydantic

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.plausibility import WIDTH
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig.complaints import one_line
from porotwin_core.rig.depth_points import depth_map, read_depth_points
from porotwin_core.rig.description import PROPERTIES, SAND_KEYS, Rig
from porotwin_core.rig.oddities import remarks_about
from porotwin_core.rig.property_file import read_property, write_map
from porotwin_core.rig.sand_drawing import (
    draw_image,
    draw_layers,
    draw_polygons,
    sand_raster,
)
from porotwin_core.rig.sand_sections import DepthPoints, DepthPointsFile
from porotwin_core.rig.sections import MapReference
from porotwin_core.rig.yaml_reader import read_yaml_file, yaml_text
from porotwin_core.rig.zone_file import read_zone

FILE_NAME = 'rig.yaml'
"""Name of the description in a folder."""


ZONE_NAMES = ('zone.nc', 'control_zone.nc')
"""Names of the file that receives a zone; the second one if a map has the first."""

LOG = logging.getLogger('porotwin')
"""Receives a warning for every odd value; commands and nodes show it."""


class ReadRig(NamedTuple):
    """A rig, and the remarks about its odd and impossible values."""

    rig: Rig
    remarks: tuple[Remark, ...]


def load_rig(path: Path | str) -> Rig:
    """Return the rig described by the file `path`, or by `rig.yaml` in the folder `path`.

    Odd values are logged as warnings.

    Raises:
        InputError: one line with the file, the key and the remedy.
    """
    path = rig_file(path)
    return parse_rig(_content(path), path)


def read_rig(path: Path | str) -> ReadRig:
    """Return the rig at `path`, as `load_rig`, with all remarks and without a log.

    Raises:
        InputError: the file is no description of a rig; impossible values are remarks.
    """
    path = rig_file(path)
    rig = _described(_content(path), path)
    return ReadRig(rig, remarks_about(rig))


def rig_file(path: Path | str) -> Path:
    """Return `path`, or the `rig.yaml` in the folder `path`."""
    path = Path(path)
    try:
        return path / FILE_NAME if path.is_dir() else path
    except OSError:  # one may not look there; its reader tells so
        return path


def names_file(description: Path, file: Path) -> bool:
    """Return whether the YAML file `description`, right or wrong, names the existing `file`."""
    if description.suffix not in ('.yaml', '.yml'):
        return False
    try:
        words = _texts(_content(description))
    except InputError:
        return False
    folder, real = description.parent.resolve(), (file.parent.resolve() / file.name, file.resolve())
    return any(Path(os.path.normpath(folder / word)) in real for word in words)


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _texts(part)


def _content(path: Path) -> Any:
    return read_yaml_file(path, remedy='name a rig.yaml or a folder with one')


def parse_rig(data: Any, path: Path) -> Rig:
    """Return the rig described by `data`, the content of the file `path`.

    Files that it names are looked for beside `path`; the file itself need not exist. Odd values are
    logged as warnings.

    Raises:
        InputError: one line with the file, the key and the remedy.
    """
    rig = _described(data, path)
    remarks = remarks_about(rig)
    refused = [remark for remark in remarks if remark.refused]
    if refused:
        others = ', '.join(remark.key for remark in refused[1:])
        more = f' (also impossible: {others})' if others else ''
        raise InputError(f'{path}: {refused[0]}{more}')
    for remark in remarks:
        LOG.warning('%s: %s', path, remark)
    return rig


def _described(data: Any, path: Path) -> Rig:
    if not isinstance(data, dict):
        raise InputError(f'{path}: not a rig description; expected keys such as name and width_m')
    try:
        rig = Rig.model_validate(data)
    except pydantic.ValidationError as error:
        raise InputError(one_line(path, error)) from None
    for key in ('width_m', 'height_m'):  # files are compared with them
        for remark in WIDTH.remarks(key, getattr(rig, key)):
            if remark.refused:
                raise InputError(f'{path}: {remark}')
    if rig.control is not None and rig.control.zone is not None:
        file = path.parent / rig.control.zone.file
        zone = read_zone(file, rig.control.zone.variable, rig.width_m, rig.height_m)
        rig = rig.with_zone(zone)
    maps: dict[str, FloatArray] = {
        name: read_property(path, name, value)
        for name in PROPERTIES
        if isinstance(value := getattr(rig, name), MapReference)
    }
    if isinstance(rig.depth_m, DepthPointsFile):
        points = read_depth_points(path.parent / rig.depth_m.points_file)
        return _described({**data, 'depth_m': {'points': points}}, path)
    if isinstance(rig.depth_m, DepthPoints):
        points_m = np.array(rig.depth_m.points)
        maps['depth_m'] = depth_map(points_m, rig.width_m, rig.height_m)
    if not rig.sands:
        return rig.with_maps(maps)
    files = {} if rig.sand_image is None else _picture(path, rig.sand_image.file)
    return rig.with_maps({**maps, **_sand_maps(rig, files, path)}, files)


def _picture(path: Path, name: str) -> dict[str, bytes]:
    try:
        return {name: read_regular(path.parent / name)}
    except OSError as error:
        raise InputError(
            f"{path}: sand_image names '{name}', which cannot be read ({error.strerror})"
        ) from None


def _sand_maps(rig: Rig, files: dict[str, bytes], path: Path) -> dict[str, FloatArray]:
    """Return porosity and permeability on the raster of the sands, each (nz, nx)."""
    names = tuple(rig.sands)
    raster = sand_raster(rig.width_m, rig.height_m)
    if rig.sand_image is None:
        labels = draw_layers(rig.sand_layers, names, raster)
    else:
        file = rig.sand_image.file
        labels = draw_image(rig.sand_image, files[file], names, raster, path.parent / file)
    labels = draw_polygons(labels, rig.sand_polygons, names, raster)
    porosity = np.array([sand.porosity for sand in rig.sands.values()])
    permeability = np.array([rig.permeability_of_sand(name) for name in names])
    return {'porosity': porosity[labels], 'permeability_m2': permeability[labels]}


def rig_from_maps(data: dict[str, Any], quantities: dict[str, float | FloatArray]) -> Rig:
    """Return the rig of `data` with properties given as numbers or arrays instead of files.

    Args:
        data: the keys of `rig.yaml` other than `quantities`; sands in it are replaced.
        quantities: depth_m [m], porosity [-], permeability_m2 [m^2]; numbers or maps (nz, nx).
            A map and its file from `write_rig` have the name of the property.

    Raises:
        InputError: one line with the key, the value and the remedy.
    """
    maps = {name: value for name, value in quantities.items() if not isinstance(value, float)}
    references = {name: MapReference(file=f'{name}.nc', variable=name) for name in maps}
    try:
        others = {
            key: value
            for key, value in data.items()
            if key not in (*SAND_KEYS, 'hydraulic_conductivity_m_s')
        }
        rig = Rig.model_validate({**others, **quantities, **references})
    except pydantic.ValidationError as error:
        raise InputError(one_line('rig description', error)) from None
    return rig.with_maps(maps)


def write_rig(
    rig: Rig, path: Path | str, *, is_taken: Callable[[str], bool] = lambda _: False
) -> None:
    """Write `rig` to the file `path`, and its maps and pictures beside it.

    Every map gets a NetCDF file of its own, with the file name in `rig`, without folders. If that
    name is not free, the file gets the name of its property, or a number. A zone from a picture
    becomes a map too.

    Args:
        rig: the rig.
        path: the file.
        is_taken: tells of a name whether no map or picture may have it.
    """
    path = Path(path)
    data = rig.model_dump(mode='json', exclude_defaults=True)
    used = {path.name}

    def free(*wanted: str) -> str:
        name = next(n for n in _numbered(wanted) if not (n in used or is_taken(n)))
        used.add(name)
        return name

    for picture, content in rig.files.items():
        name = free(Path(picture).name)
        data['sand_image']['file'] = name
        (path.parent / name).write_bytes(content)
    for quantity, values in rig.nominal_maps.items():
        reference = getattr(rig, quantity)
        if not isinstance(reference, MapReference):
            continue  # the description itself makes this map
        name = free(Path(reference.file).name, f'{quantity}.nc')
        data[quantity]['file'] = name
        grid = rig.grid(values.shape[1], values.shape[0])
        write_map(path.parent / name, reference.variable, values, grid)
    if rig.zone is not None:
        name = free(*ZONE_NAMES)
        data['control']['zone'] = {'file': name}
        write_map(path.parent / name, 'zone', rig.zone.shares, rig.zone.raster)
    path.write_text(yaml_text(data), encoding='utf-8')


def _numbered(names: Sequence[str]) -> Iterator[str]:
    """Yield `names`, and then the last one with the numbers 2, 3, ..."""
    yield from names
    last = Path(names[-1])
    for number in count(2):
        yield f'{last.stem}_{number}{last.suffix}'
