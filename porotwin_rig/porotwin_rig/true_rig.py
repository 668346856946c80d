"""The true rig: the nominal description with effects that the owner does not know."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.units import GRAVITY, MOLECULAR_DIFFUSION
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Boundaries, Rig, WaterBody
from porotwin_rig.mesh import Mesh
from porotwin_rig.water_places import WaterPlaces

FloatArray = NDArray[np.floating]
Quantity = Literal['depth_m', 'porosity', 'permeability_m2']


@dataclass(frozen=True, eq=False)
class TrueRig:
    """The rig as it is; an effect returns a copy with some fields replaced.

    Element fields have shape (nz, nx), vertex fields (nz + 1, nx + 1); everything is in SI.

    Args:
        rig: the nominal rig.
        mesh: the mesh.
        boundaries: which sides are open, and the heads of open ones.
        water: other water at the sand, by name.
        permeability: of the elements [m^2].
        depth_factor: of the elements [-]; multiplies the nominal depth.
        anisotropies: of the elements [-]; each multiplies the conductivity along x and divides it
            along z.
        depth: of the vertices [m].
        porosity: of the vertices [-].
        places: (x, z, radius) [m] of every well and of other sources and sinks.
        constant_rates: rates [m^3/s] of the sources and sinks that are no wells.
        diffusion: diffusion in the pores [m^2/s].
        longitudinal_dispersivity: dispersivity along the flow [m].
        transverse_dispersivity: dispersivity across the flow [m].
        density_difference: density of tracer stock minus density of water [kg/m^3].
        viscosity_ratio: viscosity of tracer stock relative to water [-].
        retardation_factor: factor on the storage of the mobile water [-].
        immobile_fraction: fraction of the pore water that does not move [-]; None where all moves.
        background_flux: Darcy flux (x, z) [m/s] through all four sides; None without.
        settling_velocity: velocity of tracer sinking through the water [m/s].
        table_amplitude: amplitude of the tilt of the water table [m].
        table_period: period of that tilt [s].
        clock_offset: pump time minus time of the photograph [s].
        fringe: capillary fringe above a table in the sand [m]; None where the sand is full.
    """

    rig: Rig
    mesh: Mesh
    boundaries: Boundaries
    water: Mapping[str, WaterBody]
    permeability: FloatArray
    depth_factor: FloatArray
    depth: FloatArray
    porosity: FloatArray
    places: Mapping[str, tuple[float, float, float]]
    anisotropies: tuple[FloatArray, ...] = ()
    constant_rates: Mapping[str, WellRate] = field(default_factory=dict)
    diffusion: float = MOLECULAR_DIFFUSION
    longitudinal_dispersivity: float = 0.0
    transverse_dispersivity: float = 0.0
    density_difference: float = 0.0
    viscosity_ratio: float = 1.0
    retardation_factor: float = 1.0
    immobile_fraction: float | None = None
    background_flux: tuple[float, float] | None = None
    settling_velocity: float = 0.0
    table_amplitude: float = 0.0
    table_period: float = math.inf
    clock_offset: float = 0.0
    fringe: float | None = None

    @classmethod
    def nominal(cls, rig: Rig, mesh: Mesh) -> Self:
        """Return `rig` on `mesh` without any effect."""
        return cls(
            rig=rig,
            mesh=mesh,
            boundaries=rig.boundaries,
            water=rig.water,
            fringe=None if rig.water_table is None else rig.water_table.fringe_m,
            permeability=_nearest(rig, 'permeability_m2', mesh),
            depth_factor=np.ones((mesh.nz, mesh.nx)),
            depth=_averaged(rig, 'depth_m', mesh),
            porosity=_averaged(rig, 'porosity', mesh),
            places={name: (well.x_m, well.z_m, well.radius_m) for name, well in rig.wells.items()},
        )

    def with_depth_factor(self, factor: Callable[[FloatArray, FloatArray], FloatArray]) -> Self:
        """Return the rig with its depth multiplied by `factor(x, z)`, places in [m]."""
        elements, vertices = self.element_places, self.vertex_places
        return replace(
            self,
            depth_factor=self.depth_factor * factor(*elements),
            depth=self.depth * factor(*vertices),
        )

    @property
    def element_places(self) -> tuple[FloatArray, FloatArray]:
        """Places x (1, nx) and z (nz, 1) of the middles of the elements [m]."""
        elements = self.mesh.elements
        return elements.x[None, :], elements.z[:, None]

    @property
    def vertex_places(self) -> tuple[FloatArray, FloatArray]:
        """Places x (1, nx + 1) and z (nz + 1, 1) of the vertices [m]."""
        return self.mesh.x[None, :], self.mesh.z[:, None]

    @property
    def transmissivity(self) -> tuple[FloatArray, FloatArray]:
        """Hydraulic conductivity times depth of the elements along x and z [m^2/s], (nz, nx)."""
        rig = self.rig
        conductivity = self.permeability * (rig.density_kg_m3 * GRAVITY / rig.viscosity_pa_s)
        along_x = conductivity * _nearest(rig, 'depth_m', self.mesh) * self.depth_factor
        along_z = along_x
        for anisotropy in self.anisotropies:
            along_x, along_z = along_x * anisotropy, along_z / anisotropy
        return along_x, along_z

    @property
    def water_places(self) -> WaterPlaces:
        """Where water stands or falls at the sand."""
        return self.water_places_on(self.mesh)

    def water_places_on(self, mesh: Mesh) -> WaterPlaces:
        """Return where water stands or falls at the sand, on another mesh."""
        return WaterPlaces.on(mesh, {**self.boundaries.bodies, **self.water})

    def at_levels(self, rises: Mapping[str, float]) -> Self:
        """Return the rig after its water rose by `rises` [m], by name."""
        sides = {side: rises.get(side, 0.0) for side in self.boundaries.open_sides}
        water = {
            name: body.with_change(rises.get(name, 0.0), 1.0) for name, body in self.water.items()
        }
        boundaries = self.boundaries.with_water_raised(sides, others=True)
        return replace(self, boundaries=boundaries, water=water)

    @property
    def pore_depth(self) -> FloatArray:
        """Porosity times depth of the vertices [m], (nz + 1, nx + 1)."""
        return self.porosity * self.depth

    @property
    def mobile_fraction(self) -> float:
        """Fraction [-] of the pore water that moves."""
        return 1.0 - (self.immobile_fraction or 0.0)

    @property
    def storage(self) -> FloatArray:
        """Volume per area that stores mobile and linearly sorbed tracer [m], (nz + 1, nx + 1)."""
        return self.pore_depth * self.mobile_fraction * self.retardation_factor

    def checked(self) -> Self:
        """Return the rig after a check that it is possible.

        Raises:
            InputError: the porosity exceeds 1, or a source or sink lies outside the rig.
        """
        if self.porosity.max() > 1.0 + ROUND_OFF:
            raise InputError(
                f'porosity {self.porosity.max():.6g}: must not exceed 1; '
                'lower its map or the factor of the effect'
            )
        for name, (x, z, _) in self.places.items():
            if not (0.0 < x < self.rig.width_m and 0.0 < z < self.rig.height_m):
                raise InputError(
                    f"'{name}' at ({x:.6g}, {z:.6g}) m lies outside the rig of "
                    f'{self.rig.width_m} x {self.rig.height_m} m; correct its effect'
                )
        return self


def _nearest(rig: Rig, quantity: Quantity, mesh: Mesh) -> FloatArray:
    """Return a nominal map on the elements (nz, nx), each with the value at its middle.

    Averages would soften the interfaces between sands, which are sharp.
    """
    nominal = rig.nominal_map(quantity)
    if isinstance(nominal, float):
        return np.full((mesh.nz, mesh.nx), nominal)
    rows = ((np.arange(mesh.nz) + 0.5) * nominal.shape[0] / mesh.nz).astype(int)
    columns = ((np.arange(mesh.nx) + 0.5) * nominal.shape[1] / mesh.nx).astype(int)
    return nominal[np.ix_(rows, columns)]


def _averaged(rig: Rig, quantity: Quantity, mesh: Mesh) -> FloatArray:
    """Return a nominal map averaged over the boxes of the vertices, (nz + 1, nx + 1)."""
    nominal = rig.nominal_map(quantity)
    if isinstance(nominal, float):
        return np.full(mesh.shape, nominal)
    return mesh.to_vertices(nominal)
