"""The one description of a rig: `rig.yaml`, checked at the door and then trusted."""

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import netCDF4
import numpy as np
import pydantic
import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, PrivateAttr

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample

DEFAULT_WELL_RADIUS = 0.004
"""Radius of a well whose `radius_m` is not given [m] (experiment folder contract)."""

Side = Literal['open', 'closed']
Pixel = tuple[FiniteFloat, FiniteFloat]
Point = tuple[FiniteFloat, FiniteFloat]
Positive = Annotated[FiniteFloat, Field(gt=0)]


class _Section(BaseModel):
    model_config = ConfigDict(extra='forbid', frozen=True)


class MapReference(_Section):
    """A quantity that varies over the rig: a NetCDF `variable` (z, x) in `file` beside rig.yaml."""

    file: str
    variable: str


class Boundaries(_Section):
    """`open` is a constant potential (water table); `closed` lets nothing through."""

    top: Side = 'open'
    bottom: Side = 'closed'
    left: Side = 'closed'
    right: Side = 'closed'


class Well(_Section):
    """A well as a disc of `radius_m` at its true position."""

    x_m: FiniteFloat
    z_m: FiniteFloat
    radius_m: Positive = DEFAULT_WELL_RADIUS


class Camera(_Section):
    """Where the rig lies in the photographs; pixels as (column, row).

    `corners_px`: upper left, lower left, lower right, upper right corner of the rig.
    `colour_checker_px`: dark skin, white, black, bluish green corner of the Classic chart.
    `curvature`: lens and bulge terms, see `porotwin_imaging.geometry`.
    """

    corners_px: tuple[Pixel, Pixel, Pixel, Pixel]
    colour_checker_px: tuple[Pixel, Pixel, Pixel, Pixel] | None = None
    curvature: dict[str, FiniteFloat] = Field(default_factory=dict)


class FixedWell(_Section):
    """A well that the twin does not change: its rate and what it injects."""

    rate_ml_h: FiniteFloat
    concentration: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.0


class Control(_Section):
    """What the twin may do with the wells, and where it must keep the tracer out (paper, sec. 4).

    The optimiser chooses the rates of `wells` (injecting water); `producer` takes out what all
    others inject, so that the net rate is zero. A rig with an open side may do without a producer:
    what is injected then leaves through that side. `disallowed_zone_m` is a polygon of (x, z)
    points; `fuzziness_m` is the distance over which the mask falls from 1 to 0 outside it.
    """

    wells: tuple[str, ...]
    producer: str | None = None
    fixed: dict[str, FixedWell] = Field(default_factory=dict)
    max_rate_ml_h: Positive = 500.0
    max_total_rate_ml_h: Positive = 500.0
    disallowed_zone_m: tuple[Point, ...]
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)] = 0.1

    @pydantic.field_validator('disallowed_zone_m')
    @classmethod
    def _a_polygon(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        if len(points) < 3:
            raise ValueError('needs at least three (x, z) points')
        return points


class EffectDescription(_Section):
    """An effect with its parameters, as `docs/effects.md` lists them."""

    name: str
    parameters: dict[str, FiniteFloat | str] = Field(default_factory=dict)


def _positive_or_map(value: float | MapReference) -> float | MapReference:
    if isinstance(value, float) and not value > 0:
        raise ValueError('must be positive')
    return value


Quantity = Annotated[FiniteFloat | MapReference, AfterValidator(_positive_or_map)]


class Rig(_Section):
    """The rig as its owner believes it to be; every field as in `rig.yaml`."""

    name: str
    width_m: Positive
    height_m: Positive
    depth_m: Quantity
    porosity: Quantity
    permeability_m2: Quantity
    viscosity_pa_s: Positive
    density_kg_m3: Positive
    boundaries: Boundaries = Boundaries()
    wells: dict[str, Well]
    camera: Camera | None = None
    control: Control | None = None
    effects: tuple[EffectDescription, ...] = ()
    _maps: dict[str, FloatArray] = PrivateAttr(default_factory=dict)

    @pydantic.model_validator(mode='after')
    def _consistent(self) -> Self:
        for name, well in self.wells.items():
            if not (0 < well.x_m < self.width_m and 0 < well.z_m < self.height_m):
                raise ValueError(
                    f"well '{name}' at ({well.x_m}, {well.z_m}) m lies outside the rig of "
                    f'{self.width_m} x {self.height_m} m; correct its x_m, z_m'
                )
        if isinstance(self.porosity, float) and self.porosity > 1:
            raise ValueError(f'porosity {self.porosity}: must not exceed 1')
        if self.control is not None:
            self._check_control(self.control)
        return self

    def _check_control(self, control: Control) -> None:
        producer = () if control.producer is None else (control.producer,)
        roles = [*control.wells, *producer, *control.fixed]
        for name in roles:
            if name not in self.wells:
                raise ValueError(
                    f"control names an unknown well '{name}'; known: {', '.join(self.wells)}"
                )
            if roles.count(name) > 1:
                raise ValueError(f"control gives well '{name}' two roles; keep one")
        if not producer and self.closed:
            raise ValueError('control needs a producer: every side of the rig is closed')

    @property
    def closed(self) -> bool:
        """Whether every side is closed, so that the wells must balance."""
        sides = self.boundaries
        return 'open' not in (sides.top, sides.bottom, sides.left, sides.right)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Rig)
            and self.model_dump() == other.model_dump()
            and self._maps.keys() == other._maps.keys()
            and all(np.array_equal(values, other._maps[key]) for key, values in self._maps.items())
        )

    __hash__ = None  # type: ignore[assignment]  # it holds arrays and dictionaries

    @property
    def physics_fingerprint(self) -> str:
        """Short hash of what flow and transport depend on: all but name, camera and control."""
        data = self.model_dump(mode='json', exclude={'name', 'camera', 'control'})
        for quantity, values in self._maps.items():
            # the numbers count, not the file they came from
            numbers = np.ascontiguousarray(values, dtype=float)
            data[quantity] = [values.shape, hashlib.sha256(numbers.tobytes()).hexdigest()]
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:12]

    def grid(self, nx: int, nz: int) -> Grid:
        """Return the grid of nx x nz cells over this rig."""
        return Grid(nx, nz, self.width_m, self.height_m)

    def default_grid(self, cell_m: float = 0.005) -> Grid:
        """Return the grid with square cells nearest to `cell_m`, 187 x 112 on the small rig."""
        return self.grid(
            max(1, round(self.width_m / cell_m)), max(1, round(self.height_m / cell_m))
        )

    def field(
        self, quantity: Literal['depth_m', 'porosity', 'permeability_m2'], grid: Grid
    ) -> FloatArray:
        """Return `quantity` in SI over the cells of `grid`, shape (nz, nx)."""
        value = getattr(self, quantity)
        if isinstance(value, float):
            return np.full(grid.shape, value)
        return conservative_resample(self._maps[quantity], grid.shape)

    def nominal_map(
        self, quantity: Literal['depth_m', 'porosity', 'permeability_m2']
    ) -> float | FloatArray:
        """Return `quantity` as the owner gave it: a number, or the map (nz, nx) on its own grid."""
        value = getattr(self, quantity)
        return value if isinstance(value, float) else self._maps[quantity]


_PURPOSE = {
    'name': 'a word for the rig',
    'width_m': 'the width of the sand box [m]',
    'height_m': 'the height of the sand box [m]',
    'depth_m': 'the distance between the plates [m], a number or {file:, variable:}',
    'porosity': 'the share of the volume that is pores, a number or {file:, variable:}',
    'permeability_m2': 'the permeability of the sand [m^2], a number or {file:, variable:}',
    'viscosity_pa_s': 'the viscosity of the water [Pa s]',
    'density_kg_m3': 'the density of the water [kg/m^3]',
    'wells': 'the wells by name, each with x_m and z_m',
    'x_m': 'the distance from the left edge [m]',
    'z_m': 'the height above the lower edge [m]',
    'corners_px': 'the four corners of the rig in the photographs',
}


def _one_line(path: Path, error: pydantic.ValidationError) -> str:
    """Return the first complaint of pydantic as one line for the rig's owner."""
    first = min(error.errors(), key=lambda item: item['type'] != 'extra_forbidden')
    parts = [str(part) for part in first['loc'] if part not in ('float', 'MapReference')]
    where = '.'.join(parts) or 'the description'
    more = f' (and {error.error_count() - 1} more)' if error.error_count() > 1 else ''
    if first['type'] == 'extra_forbidden':
        return f"{path}: unknown key '{where}'; correct or remove it{more}"
    if first['type'] == 'missing':
        purpose = _PURPOSE.get(parts[-1], 'needed')
        return f"{path}: '{where}' is missing: {purpose}{more}"
    if where == 'the description':
        return f'{path}: {first["msg"].removeprefix("Value error, ")}{more}'
    return (
        f'{path}: {where} = {first["input"]!r}: {first["msg"].removeprefix("Value error, ")}{more}'
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


def parse_rig(data: Any, path: Path) -> Rig:
    """Return the rig described by `data`, read from `path` (which resolves map files).

    Raises:
        InputError: one line naming the key, the value and what would mend it.
    """
    if not isinstance(data, dict):
        raise InputError(f'{path}: not a rig description; expected keys such as name and width_m')
    try:
        rig = Rig.model_validate(data)
    except pydantic.ValidationError as error:
        raise InputError(_one_line(path, error)) from None
    for quantity in ('depth_m', 'porosity', 'permeability_m2'):
        value = getattr(rig, quantity)
        if isinstance(value, MapReference):
            rig._maps[quantity] = _read_map(path, quantity, value)
    return rig


def rig_from_maps(data: dict[str, Any], quantities: dict[str, float | FloatArray]) -> Rig:
    """Return the rig of `data` whose quantities are given as numbers or maps (nz, nx), not files.

    A map is named after its quantity, the file in which `write_rig` puts it.

    Raises:
        InputError: one line naming the key, the value and what would mend it.
    """
    maps = {name: value for name, value in quantities.items() if not isinstance(value, float)}
    references = {name: MapReference(file=f'{name}.nc', variable=name) for name in maps}
    try:
        rig = Rig.model_validate({**data, **quantities, **references})
    except pydantic.ValidationError as error:
        raise InputError(_one_line(Path('rig description'), error)) from None
    rig._maps.update(maps)
    return rig


def write_rig(rig: Rig, path: Path | str) -> None:
    """Write `rig` as a rig.yaml at `path`, its maps as NetCDF files beside it.

    A map lies in a file of its own, named as in `rig` without its folders; where two maps were in
    one file, the second is named after its quantity.
    """
    path = Path(path)
    data = rig.model_dump(mode='json', exclude_defaults=True)
    taken: set[str] = set()
    for quantity, values in rig._maps.items():
        reference = getattr(rig, quantity)
        name = Path(reference.file).name
        name = f'{quantity}.nc' if name in taken else name
        taken.add(name)
        data[quantity]['file'] = name
        _write_map(path.parent / name, reference.variable, values, rig)
    path.write_text(
        yaml.safe_dump(data, sort_keys=False, default_flow_style=None), encoding='utf-8'
    )


def _write_map(file: Path, variable: str, values: FloatArray, rig: Rig) -> None:
    grid = rig.grid(values.shape[1], values.shape[0])
    with netCDF4.Dataset(file, 'w') as dataset:
        for name, coordinate in (('z', grid.z), ('x', grid.x)):
            dataset.createDimension(name, len(coordinate))
            dataset.createVariable(name, 'f8', (name,))[:] = coordinate
            dataset[name].units = 'm'
        dataset.createVariable(variable, 'f8', ('z', 'x'))[:] = values


def load_rig(path: Path | str) -> Rig:
    """Return the rig described by the file `path`, or by `rig.yaml` in the folder `path`.

    Raises:
        InputError: one line naming the file, the key and what would mend it.
    """
    path = Path(path)
    if path.is_dir():
        path = path / 'rig.yaml'
    try:
        data = yaml.safe_load(path.read_text(encoding='utf-8'))
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; name a rig.yaml or a folder with one') from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f'{path}: not readable as YAML: {" ".join(str(error).split())}') from None
    return parse_rig(data, path)
