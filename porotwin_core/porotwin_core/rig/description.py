"""A rig as its owner describes it: nominal values, before any effect is known."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
import pydantic
from numpy.typing import NDArray
from pydantic import Discriminator, Field, PrivateAttr, Tag

from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.plain_text import plain
from porotwin_core.basis.plausibility import LENGTHS
from porotwin_core.basis.text_with_unit import was_percent
from porotwin_core.basis.units import permeability_of
from porotwin_core.geometry.grid import MOST_SQUARES, FloatArray, Grid, conservative_resample
from porotwin_core.geometry.polygons import inside
from porotwin_core.geometry.zone_shapes import PictureZone
from porotwin_core.rig.control_section import Control
from porotwin_core.rig.numbers import Positive
from porotwin_core.rig.sand_sections import (
    DepthPoints,
    DepthPointsFile,
    Sand,
    SandImage,
    SandLayer,
    SandPolygon,
)
from porotwin_core.rig.sections import (
    MOST_PLACES,
    Boundaries,
    Camera,
    EffectDescription,
    LevelCourse,
    MapReference,
    Section,
    WaterBody,
    WaterTable,
    Well,
)

DEFAULT_CELL_M = 0.005
"""Cell size of the default grid [m]: finer than a plume's front, coarse enough for live control."""

FINGERPRINT_LENGTH = 12
"""Hexadecimal digits of a fingerprint: 48 bits, enough to tell the rigs of a laboratory apart."""

PropertyName = Literal['depth_m', 'porosity', 'permeability_m2']
"""A property of the rig that is one number or a map."""

PROPERTIES: tuple[PropertyName, ...] = ('depth_m', 'porosity', 'permeability_m2')
"""All properties that are one number or a map."""


PORE_SAMPLES = 100
"""Cells along each side for the pore volume; few are enough, because maps are averaged."""

SAND_KEYS = ('sands', 'sand_layers', 'sand_image', 'sand_polygons')
"""Keys that describe the sand by kinds, instead of `porosity` and `permeability_m2`."""


def _form(value: Any) -> str:
    """Return the form of a property: a number, a map, or measured points."""
    if isinstance(value, MapReference | DepthPoints | DepthPointsFile):
        return type(value).__name__
    if isinstance(value, dict) and 'points' in value:
        return DepthPoints.__name__
    if isinstance(value, dict) and 'points_file' in value:
        return DepthPointsFile.__name__
    return MapReference.__name__ if isinstance(value, dict) else 'number'


_NUMBER_OR_MAP = Annotated[Positive, Tag('number')] | Annotated[MapReference, Tag('MapReference')]

Property = Annotated[_NUMBER_OR_MAP, Discriminator(_form)]
"""A positive number, or a reference to a map."""

Depth = Annotated[
    _NUMBER_OR_MAP
    | Annotated[DepthPoints, Tag('DepthPoints')]
    | Annotated[DepthPointsFile, Tag('DepthPointsFile')],
    Discriminator(_form),
]
"""A positive number, a reference to a map, or measured points."""


class Rig(Section):
    """The rig as its owner describes it; the fields are the keys of `rig.yaml`.

    The values of maps are kept beside the references to their files, see `nominal_map`. The maps of
    sands and measured depths are kept there as well.
    """

    name: str = Field(
        min_length=1, pattern=r'^[^\x00-\x1f\x7f]*$', description='a word for the rig'
    )
    width_m: Positive = Field(description='width of the sand [m], from left to right')
    height_m: Positive = Field(description='height of the sand [m]')
    depth_m: Depth = Field(
        description='distance between the plates [m]: a number, a map {file:, variable:}, '
        'or measured points {points:} or {points_file:}'
    )
    porosity: Property | None = Field(
        None, description='volume of the pores per volume of sand [-]: a number or a map'
    )
    permeability_m2: Property | None = Field(
        None, description='permeability of the sand [m2]: a number or a map; 1 darcy is 9.87e-13 m2'
    )
    hydraulic_conductivity_m_s: Positive | None = Field(
        None, description='instead of the permeability: K = k rho g / mu of the water in the rig'
    )
    sands: dict[str, Sand] = Field(
        default_factory=dict,
        description='kinds of sand by name, instead of porosity and permeability',
    )
    sand_layers: tuple[SandLayer, ...] = Field(
        (), description='layers of sand, the lowest first; the last one fills the rig'
    )
    sand_image: SandImage | None = Field(
        None, description='instead of layers: a picture with a colour for every sand'
    )
    sand_polygons: tuple[SandPolygon, ...] = Field(
        (), description='polygons of sand over layers or picture, the last one on top'
    )
    viscosity_pa_s: Positive = Field(description='dynamic viscosity of the water [Pa s]')
    density_kg_m3: Positive = Field(description='density of the water [kg/m3]')
    boundaries: Boundaries = Field(Boundaries(), description='conditions on the four sides')
    water: dict[str, WaterBody] = Field(
        default_factory=dict,
        description='water at the sand by name, beside the open sides: heads on parts of sides, '
        'open water in the picture, rain',
    )
    levels: dict[str, LevelCourse] = Field(
        default_factory=dict,
        description='how levels change, by the name of an open side or of `water`',
    )
    water_table: WaterTable | None = Field(
        None, description='a water table inside the sand; without it the sand is full of water'
    )
    wells: dict[str, Well] = Field(description='wells by name')
    camera: Camera | None = Field(None, description='needed for photographs')
    control: Control | None = Field(None, description='needed for setpoints')
    effects: tuple[EffectDescription, ...] = Field(
        (), description='physical effects that a diagnosis found'
    )
    _nominal_maps: dict[str, FloatArray] = PrivateAttr(default_factory=dict)
    _files: dict[str, bytes] = PrivateAttr(default_factory=dict)
    _zone: PictureZone | None = PrivateAttr(default=None)

    @pydantic.model_validator(mode='after')
    def _is_consistent(self) -> Self:
        if len(self.wells) > MOST_PLACES:
            raise ValueError(f'{len(self.wells)} wells: describe at most {MOST_PLACES}')
        for name, well in self.wells.items():
            if not (name.isprintable() and name.strip() and plain(name) == name):
                raise ValueError(f'well {name!r}: its name cannot be printed in a line; rename it')
            if not (0 < well.x_m < self.width_m and 0 < well.z_m < self.height_m):
                where = 'on the edge of' if self._is_on_edge(well) else 'outside'
                raise ValueError(
                    f"well '{name}' at ({well.x_m}, {well.z_m}) m lies {where} the rig of "
                    f'{self.width_m} x {self.height_m} m; {self._place_remedy(well)}'
                )
        if isinstance(self.porosity, float) and self.porosity > 1:
            raise ValueError(
                f'porosity {self.porosity}: must not exceed 1{was_percent(self.porosity)}'
            )
        self._check_sands()
        self._check_water()
        if self.control is not None:
            self.control.check_wells(self.wells, closed=self.closed)
        return self

    def _is_on_edge(self, well: Well) -> bool:
        """Return whether `well`, which is not inside the rig, is not outside of it either."""
        return 0 <= well.x_m <= self.width_m and 0 <= well.z_m <= self.height_m

    def _place_remedy(self, well: Well) -> str:
        """Return the remedy for the place of `well`: in another unit it may lie in the rig."""
        guesses, exchanged = [], ''
        if 0 < well.z_m < self.width_m and 0 < well.x_m < self.height_m:
            exchanged = f'were x_m and z_m exchanged? ({well.z_m:g}, {well.x_m:g}) m lies inside'
        if self._is_on_edge(well):
            return (
                f'x_m must be above 0 and below {self.width_m:g}, z_m above 0 '
                f'and below {self.height_m:g}; move it into the sand by its radius of '
                f'{well.radius_m:g} m, or describe an overflow as an open side; {exchanged}'
            ).removesuffix('; ')
        if exchanged:
            return exchanged
        for unit, factor in LENGTHS:
            x, z = well.x_m * factor, well.z_m * factor
            if 0 < x < self.width_m and 0 < z < self.height_m:
                guesses.append(f'in {unit}, ({x:g}, {z:g}) m')
        question = f'; was this {" or ".join(guesses)}?' if guesses else ''
        return f'correct its x_m, z_m{question}'

    def _check_sands(self) -> None:
        """Check that the sand is described in one way, and that all its names are known.

        Raises:
            ValueError: it is described twice or not at all, or a name is unknown.
        """
        plain = {
            key: getattr(self, key)
            for key in ('porosity', 'permeability_m2', 'hydraulic_conductivity_m_s')
            if getattr(self, key) is not None
        }
        if not self.sands:
            self._check_plain(plain)
            return
        if plain:
            raise ValueError(f'{next(iter(plain))} and sands both describe the sand; keep one')
        if bool(self.sand_layers) == (self.sand_image is not None):
            raise ValueError(
                'sands need their places: give either sand_layers or sand_image '
                '(one sand everywhere: sand_layers: [{sand: NAME}])'
            )
        if self.sand_layers and self.sand_layers[-1].top_m is not None:
            raise ValueError('the last of sand_layers fills the rig; remove its top_m')
        for number, layer in enumerate(self.sand_layers[:-1], start=1):
            if layer.top_m is None:
                raise ValueError(
                    f'layer {number} of sand_layers needs a top_m; only the last has none'
                )
        for name in self.placed_sands:
            if name not in self.sands:
                raise ValueError(f"sand '{name}' is unknown; sands has {', '.join(self.sands)}")

    def _check_water(self) -> None:
        """Check that the water bodies lie apart on the sides, and that their heads are known.

        Raises:
            ValueError: they overlap, reach beyond the rig, have no head, or no outlet.
        """
        sides = self.boundaries
        taken: dict[str, list[tuple[float, float, str]]] = {}
        for name, body in self.water.items():
            if not (name.isprintable() and name.strip()) or name in sides.open_sides:
                raise ValueError(f"water '{name}': give it another name")
            if body.side is None:
                continue
            length = self.height_m if body.side in ('left', 'right') else self.width_m
            end = body.to_m or length
            if body.from_m >= min(end, length) or end > length * (1.0 + ROUND_OFF):
                raise ValueError(
                    f"water '{name}' reaches from {body.from_m:g} to {end:g} m, but the "
                    f'{body.side} side is {length:g} m long; correct from_m and to_m'
                )
            if body.side in sides.open_sides:
                raise ValueError(
                    f"water '{name}' stands at the {body.side} side, which is open as a whole; "
                    f'write {body.side}: closed in boundaries'
                )
            for low, high, other in taken.setdefault(body.side, []):
                if body.from_m < high and low < end:
                    raise ValueError(f"water '{name}' overlaps '{other}'; correct from_m and to_m")
            taken[body.side].append((body.from_m, end, name))
        has_heads = any(body.head_m is not None for body in self.water.values())
        if (
            (has_heads or self.levels or self.water_table)
            and sides.open_sides
            and not sides.heads_m
        ):
            raise ValueError(
                f'the {" and ".join(sides.open_sides)} side is open without a head; give '
                'boundaries.heads_m, or close it (the top is open unless you write top: closed)'
            )
        if self.closed and (self.water or self.water_table):
            raise ValueError('water cannot leave: give some water a head_m')
        heads = [name for name, body in self.water_bodies.items() if body.head_m is not None]
        for name in self.levels:
            if name not in heads:
                known = ', '.join(heads) or 'none'
                raise ValueError(f"levels: no water '{name}' has a head; known: {known}")
            if name in self.wells:
                raise ValueError(f"levels: '{name}' is water and a well; rename one of them")

    @property
    def water_bodies(self) -> dict[str, WaterBody]:
        """All water at the sand by name: of the open sides and of `water`."""
        return {**self.boundaries.bodies, **self.water}

    def wet_sand(self, grid: Grid) -> NDArray[np.bool_]:
        """Return the cells (nz, nx) in sand with water, by the centre of each.

        Open water is no sand. With a water table the sand is dry above the fringe over the highest
        level, unless it rains.
        """
        x, z = np.meshgrid(grid.x, grid.z)
        places = np.stack([x.ravel(), z.ravel()], axis=1)
        wet = np.ones(grid.shape, dtype=bool)
        for body in self.water.values():
            if body.corners_m is not None:
                wet &= ~inside(places, np.array(body.corners_m)).reshape(grid.shape)
        heads = [b.head_m for b in self.water_bodies.values() if b.head_m is not None]
        heads += [level for course in self.levels.values() for _, level in course.points]
        rains = any((body.rate_ml_h or 0.0) > 0.0 for body in self.water.values())
        if self.water_table is not None and not rains:
            wet &= z < max(heads) + self.water_table.fringe_m
        return wet

    @property
    def is_driven(self) -> bool:
        """Whether water flows without wells: by heads that differ or change, rain, dense water."""
        rains = any(body.rate_ml_h or body.concentration for body in self.water.values())
        heads = {body.head_m for body in self.water_bodies.values()} - {None}
        return rains or bool(self.levels) or len(heads) > 1

    @property
    def placed_sands(self) -> tuple[str, ...]:
        """The names of the sands in layers, picture and polygons."""
        legend = () if self.sand_image is None else tuple(self.sand_image.legend.values())
        layers = tuple(layer.sand for layer in self.sand_layers)
        return legend + layers + tuple(polygon.sand for polygon in self.sand_polygons)

    def _check_plain(self, plain: dict[str, Any]) -> None:
        if any(getattr(self, key) for key in SAND_KEYS[1:]):
            raise ValueError("'sands' is missing: the kinds of sand by name")
        if 'porosity' not in plain:
            raise ValueError("'porosity' is missing: volume of the pores per volume of sand [-]")
        if len(plain) == 1:
            raise ValueError(
                "'permeability_m2' is missing: permeability of the sand [m2], or give "
                'hydraulic_conductivity_m_s [m/s]'
            )
        if len(plain) > 2:  # porosity and one permeability
            raise ValueError(
                'permeability_m2 and hydraulic_conductivity_m_s are both given; keep one'
            )

    @property
    def closed(self) -> bool:
        """Whether no water has a head, so that the wells must balance."""
        return self.boundaries.all_closed and all(
            body.head_m is None for body in self.water.values()
        )

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Rig)
            and self.model_dump() == other.model_dump()
            and self._nominal_maps.keys() == other._nominal_maps.keys()
            and all(
                np.array_equal(values, other._nominal_maps[key])
                for key, values in self._nominal_maps.items()
            )
            and np.array_equal(self._zone_shares, other._zone_shares)
        )

    __hash__ = None  # type: ignore[assignment]  # it holds arrays and dictionaries

    def with_maps(
        self, maps: Mapping[str, FloatArray], files: Mapping[str, bytes] | None = None
    ) -> Self:
        """Return this rig with the numbers of its maps, (nz, nx) by property name, row 0 lowest.

        The properties must be references already; `rig_from_maps` makes both at once. `files` are
        pictures that the description names; `write_rig` writes them again.
        """
        copy = self.model_copy()
        copy._nominal_maps = {**self._nominal_maps, **maps}
        copy._files = {**self._files, **(files or {})}
        return copy

    def with_zone(self, zone: PictureZone) -> Self:
        """Return this rig with the `zone` that the file in `control.zone` shows."""
        copy = self.model_copy()
        copy._zone = zone
        return copy

    @property
    def zone(self) -> PictureZone | None:
        """The zone that the file in `control.zone` shows; None: there is no such file."""
        return self._zone if self.control is not None and self.control.zone is not None else None

    @property
    def _zone_shares(self) -> FloatArray:
        return np.empty(0) if self._zone is None else self._zone.shares

    @property
    def physics_fingerprint(self) -> str:
        """Short hash of everything that flow and transport depend on.

        It covers the whole description except name, camera and control. For a map it covers the
        values, not the name of the file.
        """
        apart = {'name', 'camera', 'control', 'hydraulic_conductivity_m_s', *SAND_KEYS}
        data = self.model_dump(mode='json', exclude=apart)
        del data['boundaries']['heads_m']
        for well in data['wells'].values():
            del well['rate_prior_ml_h']
        for body in data['water'].values():
            if not body['diffuses']:  # older rigs know no such key
                del body['diffuses']
        if raised := self.boundaries.raised_heads:  # only differences count
            data['boundaries']['raised_heads_m'] = raised
        if self.water:  # beside other water the level counts
            data['boundaries']['heads_m'] = self.boundaries.heads_m
        for key in ('water', 'levels', 'water_table'):
            data = {name: value for name, value in data.items() if name != key or value}
        for name in PROPERTIES:
            values = self.nominal_map(name)
            if isinstance(values, float):
                data[name] = values
                continue
            numbers = np.ascontiguousarray(values, dtype=float)
            data[name] = [values.shape, hashlib.sha256(numbers.tobytes()).hexdigest()]
        digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
        return digest[:FINGERPRINT_LENGTH]

    def keys_that_differ(self, other: 'Rig') -> list[str]:
        """Return the keys of rig.yaml, without the name, whose values or maps differ.

        A bag keeps the drawn maps of sands, which then do not differ.
        """
        own, others = (rig.model_dump(mode='json', exclude={'name'}) for rig in (self, other))
        maps = {
            key: np.array_equal(values, other._nominal_maps.get(key, np.empty(0)))
            for key, values in self._nominal_maps.items()
        }
        same = {key for key, equal in maps.items() if equal}
        if {'porosity', 'permeability_m2'} <= same and not (self.sands and other.sands):
            same.update(SAND_KEYS)
        return [
            key
            for key, value in own.items()
            if key not in same and (value != others[key] or key in maps)
        ]

    def with_effects(self, effects: Iterable[EffectDescription]) -> Self:
        """Return this rig with additional `effects`."""
        return self.model_copy(update={'effects': (*self.effects, *effects)})

    def grid(self, nx: int, nz: int) -> Grid:
        """Return the grid of nx x nz cells over this rig.

        Raises:
            InputError: no cells.
        """
        return Grid(nx, nz, self.width_m, self.height_m)

    def default_grid(self, cell_m: float | None = None) -> Grid:
        """Return the grid with square cells nearest to `cell_m` [m].

        By default cells measure `DEFAULT_CELL_M`, 187 x 112 on the small rig. On a rig with more
        than `MOST_SQUARES` of these they are 2, 4, 8, ... times as large.
        """
        cell = cell_m or DEFAULT_CELL_M
        while cell_m is None and self.width_m * self.height_m > MOST_SQUARES * cell**2:
            cell *= 2.0
        return self.grid(max(1, round(self.width_m / cell)), max(1, round(self.height_m / cell)))

    def field(self, quantity: PropertyName, grid: Grid) -> FloatArray:
        """Return a property in SI over the cells of `grid`, shape (nz, nx), row 0 lowest.

        A map is averaged over the cells, by area.
        """
        value = self.nominal_map(quantity)
        if isinstance(value, float):
            return np.full(grid.shape, value)
        return conservative_resample(value, grid.shape)

    def nominal_map(self, quantity: PropertyName) -> float | FloatArray:
        """Return a property as described: a number, or the map (nz, nx) on its own grid.

        Sands and measured depths are maps on a raster (see `sand_drawing`, `depth_points`).
        """
        if quantity in self._nominal_maps:
            return self._nominal_maps[quantity]
        value = getattr(self, quantity)
        if value is None and quantity == 'permeability_m2':
            return self._permeability_of(self.hydraulic_conductivity_m_s)
        return float(value)

    def permeability_of_sand(self, name: str) -> float:
        """Return the permeability [m^2] of the sand `name`.

        A hydraulic conductivity becomes a permeability with the water of this rig.
        """
        sand = self.sands[name]
        return sand.permeability_m2 or self._permeability_of(sand.hydraulic_conductivity_m_s)

    def is_of_sand(self, name: str) -> NDArray[np.bool_]:
        """Return where the sand `name` lies, (nz, nx) on the raster of the sands."""
        own = self.permeability_of_sand(name)
        same_porosity = self.nominal_map('porosity') == self.sands[name].porosity
        return np.asarray(same_porosity & (self.nominal_map('permeability_m2') == own))

    def _permeability_of(self, conductivity: float | None) -> float:
        """Return the permeability [m^2] of a hydraulic conductivity [m/s] for this rig's water."""
        assert conductivity is not None
        return permeability_of(conductivity, self.viscosity_pa_s, self.density_kg_m3)

    @property
    def pore_volume(self) -> float:
        """Volume of the pores of the `wet_sand` [m^3]; of all sand, where levels miss all of it."""
        grid = self.grid(PORE_SAMPLES, PORE_SAMPLES)
        pores = self.cell_pore_volume(grid)
        return float(pores[self.wet_sand(grid)].sum() or pores.sum())

    def cell_pore_volume(self, grid: Grid) -> FloatArray:
        """Return the volume of the pores of each cell of `grid` [m^3], (nz, nx)."""
        pores: FloatArray = self.field('porosity', grid) * self.field('depth_m', grid)
        return pores * grid.cell_area

    @property
    def nominal_maps(self) -> dict[str, FloatArray]:
        """The properties that are maps, (nz, nx) by name, each on its own grid."""
        return dict(self._nominal_maps)

    @property
    def files(self) -> dict[str, bytes]:
        """The pictures that the description names, by the name of the file."""
        return dict(self._files)
