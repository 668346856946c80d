"""A rig as its owner describes it: nominal values, before any effect is known."""

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Literal, Self

import numpy as np
import pydantic
from pydantic import AfterValidator, FiniteFloat, PrivateAttr

from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig.control_section import Control
from porotwin_core.rig.sections import (
    Boundaries,
    Camera,
    EffectDescription,
    MapReference,
    Positive,
    Section,
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


def _positive_or_map(value: float | MapReference) -> float | MapReference:
    if isinstance(value, float) and not value > 0:
        raise ValueError('must be positive')
    return value


Property = Annotated[FiniteFloat | MapReference, AfterValidator(_positive_or_map)]
"""A positive number, or a reference to a map."""


class Rig(Section):
    """The rig as its owner describes it; the fields are the keys of `rig.yaml`.

    The numbers of the maps are kept beside the references to their files, see `nominal_map`.
    """

    name: str
    width_m: Positive
    height_m: Positive
    depth_m: Property
    porosity: Property
    permeability_m2: Property
    viscosity_pa_s: Positive
    density_kg_m3: Positive
    boundaries: Boundaries = Boundaries()
    wells: dict[str, Well]
    camera: Camera | None = None
    control: Control | None = None
    effects: tuple[EffectDescription, ...] = ()
    _nominal_maps: dict[str, FloatArray] = PrivateAttr(default_factory=dict)

    @pydantic.model_validator(mode='after')
    def _is_consistent(self) -> Self:
        for name, well in self.wells.items():
            if not (0 < well.x_m < self.width_m and 0 < well.z_m < self.height_m):
                raise ValueError(
                    f"well '{name}' at ({well.x_m}, {well.z_m}) m lies outside the rig of "
                    f'{self.width_m} x {self.height_m} m; correct its x_m, z_m'
                )
        if isinstance(self.porosity, float) and self.porosity > 1:
            raise ValueError(f'porosity {self.porosity}: must not exceed 1')
        if self.control is not None:
            self.control.check_wells(self.wells, closed=self.closed)
        return self

    @property
    def closed(self) -> bool:
        """Whether every side is closed, so that the wells must balance."""
        sides = self.boundaries
        return 'open' not in (sides.top, sides.bottom, sides.left, sides.right)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Rig)
            and self.model_dump() == other.model_dump()
            and self._nominal_maps.keys() == other._nominal_maps.keys()
            and all(
                np.array_equal(values, other._nominal_maps[key])
                for key, values in self._nominal_maps.items()
            )
        )

    __hash__ = None  # type: ignore[assignment]  # it holds arrays and dictionaries

    def with_maps(self, maps: Mapping[str, FloatArray]) -> Self:
        """Return this rig with the numbers of its maps, (nz, nx) by property name, row 0 lowest.

        The properties must be references already; `rig_from_maps` makes both at once.
        """
        copy = self.model_copy()
        copy._nominal_maps = {**self._nominal_maps, **maps}
        return copy

    @property
    def physics_fingerprint(self) -> str:
        """Short hash of everything that flow and transport depend on.

        That is the whole description except name, camera and control. Of a map the numbers count,
        not the name of its file.
        """
        data = self.model_dump(mode='json', exclude={'name', 'camera', 'control'})
        for name, values in self._nominal_maps.items():
            numbers = np.ascontiguousarray(values, dtype=float)
            data[name] = [values.shape, hashlib.sha256(numbers.tobytes()).hexdigest()]
        digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
        return digest[:FINGERPRINT_LENGTH]

    def grid(self, nx: int, nz: int) -> Grid:
        """Return the grid of nx x nz cells over this rig.

        Raises:
            InputError: no cells.
        """
        return Grid(nx, nz, self.width_m, self.height_m)

    def default_grid(self, cell_m: float = DEFAULT_CELL_M) -> Grid:
        """Return the grid with square cells nearest to `cell_m` [m], 187 x 112 on the small rig."""
        return self.grid(
            max(1, round(self.width_m / cell_m)), max(1, round(self.height_m / cell_m))
        )

    def field(self, quantity: PropertyName, grid: Grid) -> FloatArray:
        """Return a property in SI over the cells of `grid`, shape (nz, nx), row 0 lowest."""
        value = getattr(self, quantity)
        if isinstance(value, float):
            return np.full(grid.shape, value)
        return conservative_resample(self._nominal_maps[quantity], grid.shape)

    def nominal_map(self, quantity: PropertyName) -> float | FloatArray:
        """Return a property as described: a number, or the map (nz, nx) on its own grid."""
        value = getattr(self, quantity)
        return value if isinstance(value, float) else self._nominal_maps[quantity]

    @property
    def nominal_maps(self) -> dict[str, FloatArray]:
        """The properties that are maps, (nz, nx) by name, each on its own grid."""
        return dict(self._nominal_maps)
