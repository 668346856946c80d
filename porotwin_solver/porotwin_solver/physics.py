"""What the model believes of the rig, in SI on the cells of one grid: the subject of effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import DEFAULT_WELL_RADIUS, Boundaries, Rig
from porotwin_core.units import MOLECULAR_DIFFUSION


@dataclass(frozen=True)
class SourceSink:
    """Where water enters or leaves: a disc of `radius` about (`x`, `z`) [m]."""

    x: float
    z: float
    radius: float = DEFAULT_WELL_RADIUS


@dataclass(frozen=True)
class Leak:
    """Water lost or gained at a constant `rate` [m^3/s], positive into the rig, without tracer."""

    source_sink: SourceSink
    rate: float


@dataclass(frozen=True)
class Physics:
    """Coefficients of flow and transport; fields are (nz, nx) on `grid`, everything in SI.

    An effect returns a copy with some of these replaced (`dataclasses.replace`).
    """

    grid: Grid
    depth: FloatArray
    porosity: FloatArray
    permeability: FloatArray
    viscosity: float
    boundaries: Boundaries
    wells: Mapping[str, SourceSink]
    rate_factors: Mapping[str, float] = field(default_factory=dict)
    diffusion: float = MOLECULAR_DIFFUSION
    longitudinal_dispersivity: float = 0.0
    transverse_dispersivity: float = 0.0
    model_diffusion: float = 0.0
    density_difference: float = 0.0
    viscosity_ratio: float = 1.0
    retardation_factor: float = 1.0
    decay_rate: float = 0.0
    immobile_fraction: float = 0.0
    exchange_rate: float = 0.0
    leaks: tuple[Leak, ...] = ()
    background_flux: tuple[float, float] = (0.0, 0.0)

    @property
    def volume(self) -> FloatArray:
        """Rig volume of every cell [m^3], (nz, nx)."""
        return self.depth * self.grid.cell_area

    @property
    def storage(self) -> FloatArray:
        """Volume that stores tracer at the concentration the camera sees [m^3], (nz, nx)."""
        return self.volume * self.porosity * self.retardation_factor

    @property
    def mobile_water(self) -> FloatArray:
        """Volume of the water that moves [m^3], (nz, nx)."""
        return self.volume * self.porosity * (1.0 - self.immobile_fraction)

    @property
    def disperses(self) -> bool:
        """Whether the spreading of the tracer depends on the flow."""
        return self.longitudinal_dispersivity != 0.0 or self.transverse_dispersivity != 0.0

    @property
    def is_coupled(self) -> bool:
        """Whether the flow depends on where the tracer is."""
        return self.density_difference != 0.0 or self.viscosity_ratio != 1.0

    def well(self, name: str) -> str:
        """Return `name` where it is a well.

        Raises:
            InputError: the rig has no such well; the message lists those it has.
        """
        if name not in self.wells:
            raise InputError(f"unknown well '{name}'; known: {', '.join(self.wells)}")
        return name


def nominal_physics(rig: Rig, grid: Grid) -> Physics:
    """Return what `rig.yaml` says, on the cells of `grid`, without any effect.

    Raises:
        InputError: the grid does not cover the rig, or a map is not positive (porosity above 1).
    """
    if not np.allclose((grid.width, grid.height), (rig.width_m, rig.height_m), rtol=1e-9):
        raise InputError(
            f'grid of {grid.width} m x {grid.height} m: rig {rig.name!r} measures '
            f'{rig.width_m} m x {rig.height_m} m; make the grid with rig.grid(nx, nz)'
        )
    physics = Physics(
        grid=grid,
        depth=rig.field('depth_m', grid),
        porosity=rig.field('porosity', grid),
        permeability=rig.field('permeability_m2', grid),
        viscosity=rig.viscosity_pa_s,
        boundaries=rig.boundaries,
        wells={
            name: SourceSink(well.x_m, well.z_m, well.radius_m) for name, well in rig.wells.items()
        },
    )
    check(physics)
    return physics


def check(physics: Physics) -> None:
    """Refuse fields that no rig can have.

    Raises:
        InputError: names the field, the offending value and the remedy.
    """
    fields = {
        'depth': physics.depth,
        'porosity': physics.porosity,
        'permeability': physics.permeability,
    }
    for name, values in fields.items():
        if not np.isfinite(values).all():
            raise InputError(f'{name}: not finite everywhere; fill the gaps of its map')
        if values.min() <= 0:
            raise InputError(f'{name} {values.min():.6g}: must be positive everywhere')
    if physics.porosity.max() > 1:
        raise InputError(f'porosity {physics.porosity.max():.6g}: must not exceed 1')
    sources_and_sinks = {f"well '{name}'": well for name, well in physics.wells.items()}
    sources_and_sinks |= {f'leak {n + 1}': leak.source_sink for n, leak in enumerate(physics.leaks)}
    for name, well in sources_and_sinks.items():
        if not (0 < well.x < physics.grid.width and 0 < well.z < physics.grid.height):
            raise InputError(
                f'{name} at ({well.x:.6g}, {well.z:.6g}) m lies outside the rig of '
                f'{physics.grid.width} x {physics.grid.height} m; correct its position'
            )
