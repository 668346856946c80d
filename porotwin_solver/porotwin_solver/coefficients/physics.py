"""The coefficients of flow and transport, in SI on the cells of one grid; effects change them."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.units import GRAVITY, MOLECULAR_DIFFUSION
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import DEFAULT_WELL_RADIUS, Boundaries, Rig, WaterBody
from porotwin_solver.coefficients.water_contact import Outline, WaterContact, contact_of

MOST_CONTRAST = 1e12
"""Largest over least permeability [-]. From 1e13 on the round-off of the flow shows: more than the
injected concentration. Clay and gravel differ by 1e10."""


@dataclass(frozen=True)
class SourceSink:
    """The place where water enters or leaves: a disc of `radius` [m] about (`x` [m], `z` [m])."""

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
    """Coefficients of flow and transport. Fields are (nz, nx) on `grid`, everything is in SI.

    An effect returns a copy with some of them replaced (`dataclasses.replace`).

    depth: distance between the plates [m].
    porosity: [-].
    permeability: [m^2].
    viscosity: of water [Pa s].
    density: of water [kg/m^3].
    boundaries: which sides are open (constant potential) or closed, and heads of open ones.
    water: other water at the sand, by name.
    levels: names of the water whose level changes; rates must name it.
    fringe: height of the capillary fringe [m] above a table in the sand; None: the sand is full.
    surface: the contact with water at a known table; None: it follows from the bodies.
    blocks: cells along each side of the blocks of which the contact with water consists.
    wells: place of every well by name.
    rate_factors: delivered rate of a well divided by the commanded one [-]; 1 where absent.
    stock_factors: concentration that a well injects divided by the commanded one [-], likewise.
    dead_volumes: water in the tube of a well before its tracer [m^3]; in free runs only.
    diffusion: molecular diffusion of the tracer in the pores [m^2/s].
    longitudinal_dispersivity, transverse_dispersivity: Scheidegger's a_L and a_T [m].
    model_diffusion: artificial isotropic diffusion [m^2/s].
    density_difference: density of the tracer stock minus the density of water [kg/m^3].
    viscosity_ratio: viscosity of the tracer stock divided by the viscosity of water [-].
    retardation_factor: linear sorption, R >= 1 [-].
    decay_rate: first-order decay [1/s].
    immobile_fraction: fraction of the pore water that does not move [-].
    exchange_rate: d c_immobile / dt = exchange_rate (c_mobile - c_immobile) [1/s].
    leaks: unknown sources and sinks.
    background_flux: Darcy flux (x, z) imposed on the sides [m/s].
    table_tilt: pressure on an open upper side, right end minus left end [Pa].
    """

    grid: Grid
    depth: FloatArray
    porosity: FloatArray
    permeability: FloatArray
    viscosity: float
    density: float
    boundaries: Boundaries
    wells: Mapping[str, SourceSink]
    water: Mapping[str, WaterBody] = field(default_factory=dict)
    levels: frozenset[str] = frozenset()
    blocks: int = 1
    fringe: float | None = None
    surface: WaterContact | None = None
    rate_factors: Mapping[str, float] = field(default_factory=dict)
    stock_factors: Mapping[str, float] = field(default_factory=dict)
    dead_volumes: Mapping[str, float] = field(default_factory=dict)
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
    table_tilt: float = 0.0

    @property
    def volume(self) -> FloatArray:
        """Rig volume of every cell [m^3], (nz, nx)."""
        return self.depth * self.grid.cell_area

    @property
    def mobility_thickness(self) -> FloatArray:
        """d k / mu of pure water [m^3/(Pa s)], (nz, nx): the coefficient of the pressure."""
        return self.depth * self.permeability / self.viscosity

    @property
    def storage(self) -> FloatArray:
        """Tracer of a cell per unit of concentration [m^3], (nz, nx): volume * porosity * R."""
        return self.volume * self.porosity * self.retardation_factor

    @property
    def mobile_water(self) -> FloatArray:
        """Volume of the moving pore water [m^3], (nz, nx)."""
        return self.volume * self.porosity * (1.0 - self.immobile_fraction)

    @cached_property
    def moving_volume(self) -> float:
        """Volume of all moving pore water [m^3]."""
        return float(np.sum(self.mobile_water))

    @property
    def disperses(self) -> bool:
        """Whether the dispersion of the tracer depends on the flow."""
        return self.longitudinal_dispersivity != 0.0 or self.transverse_dispersivity != 0.0

    @property
    def is_coupled(self) -> bool:
        """Whether the flow depends on the concentration."""
        return self.density_difference != 0.0 or self.viscosity_ratio != 1.0

    @cached_property
    def contact(self) -> WaterContact:
        """Where water stands or falls at the sand."""
        if self.surface is not None:
            return self.surface
        bodies = {**self.boundaries.bodies, **self.water}
        return contact_of(self.grid, bodies, blocks=self.blocks, seeps=self.fringe is not None)

    @cached_property
    def water_potentials(self) -> tuple[Outline, FloatArray] | None:
        """Potential [Pa] of the water at the outer faces and in canals; None: 0 everywhere.

        With the tilt t [Pa], an open upper side also has t (x / W - 1/2).
        """
        weight, excess = self.density * GRAVITY, self.density_difference * GRAVITY
        found = self.contact.potentials(self.grid, weight, excess)
        if self.table_tilt == 0.0 or self.boundaries.top != 'open':
            return found
        outer, inner = found or (Outline.zeros(self.grid), np.zeros(self.grid.shape))
        tilt = self.table_tilt * (self.grid.x / self.grid.width - 0.5)
        return outer._replace(top=outer.top + tilt), inner

    def delivered(self, rates: WellRates) -> dict[str, float]:
        """Return the rate [m^3/s] of every well: the commanded one times its rate factor.

        In a closed rig with rate factors the sinks follow: sand and water are incompressible, so
        that the pressure at the sinks changes until the rates balance. All sinks are multiplied by

            (injected / withdrawn with factors) / (injected / withdrawn as commanded),

        which is 1 without factors, and leaves commands that do not balance unbalanced.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        water = (*self.boundaries.open_sides, *self.water)
        found = {
            name: well.rate * self.rate_factors.get(self.well(name), 1.0)
            for name, well in rates.items()
            if name in self.wells or name not in water
        }
        if not self.rate_factors or not self.contact.closed:
            return found
        put_in, taken = in_and_out(found.values())
        asked_in, asked_out = in_and_out(well.rate for well in rates.values())
        if taken == 0.0 or asked_in == 0.0:
            return found
        follow = put_in * asked_out / (taken * asked_in)
        return {name: rate if rate > 0.0 else follow * rate for name, rate in found.items()}

    def surplus(self, rates: WellRates) -> float:
        """Return the rate [m^3/s] that wells and leaks put into a closed rig and nobody takes out.

        It is 0 with an open side, and within the round-off of rates that balance.

        Raises:
            InputError: as `delivered`.
        """
        each = [*self.delivered(rates).values(), *(leak.rate for leak in self.leaks)]
        net, total = math.fsum(each), math.fsum(map(abs, each))
        return net if self.contact.closed and abs(net) > ROUND_OFF * total else 0.0

    def pumped(self, rates: WellRates) -> dict[str, WellRate]:
        """Return `rates` of wells as `delivered`, with the fluids that were commanded."""
        return {
            name: replace(rates[name], rate=rate) for name, rate in self.delivered(rates).items()
        }

    def injected(self, rates: WellRates) -> dict[str, WellRate]:
        """Return `rates` of wells as `pumped`, with the concentrations of their bottles."""
        return {
            name: replace(one, concentration=one.concentration * self.stock_factors.get(name, 1.0))
            for name, one in self.pumped(rates).items()
        }

    def at_levels(self, rates: WellRates) -> 'Physics':
        """Return these coefficients with the levels of water that `rates` name.

        Raises:
            InputError: they do not name all water whose level changes.
        """
        if not self.levels:
            return self
        if missing := self.levels - rates.keys():
            raise InputError(
                f'levels: the level of {", ".join(sorted(missing))} changes, which these rates do '
                'not tell; COSTA cannot follow it, and a program names the levels by '
                'FixedPauses.of(rig).in_schedule(rates)'
            )
        rises = {name: rates[name].rise for name in self.levels}
        water = {
            name: body.with_change(rises.get(name, 0.0), 1.0) for name, body in self.water.items()
        }
        sides = {side: rises.get(side, 0.0) for side in self.boundaries.open_sides}
        raised = self.boundaries.with_water_raised(sides, others=True)
        return replace(self, boundaries=raised, water=water)

    def well(self, name: str) -> str:
        """Return `name` if it is a well.

        Raises:
            InputError: the rig has no such well; the message lists its wells.
        """
        if name not in self.wells:
            raise InputError(f"unknown well '{name}'; known: {', '.join(self.wells)}")
        return name


def nominal_physics(rig: Rig, grid: Grid) -> Physics:
    """Return the coefficients of `rig.yaml` on the cells of `grid`, without any effect.

    Raises:
        InputError: the grid does not cover the rig, or as `check`.
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
        density=rig.density_kg_m3,
        boundaries=rig.boundaries,
        wells={
            name: SourceSink(well.x_m, well.z_m, well.radius_m) for name, well in rig.wells.items()
        },
        water=rig.water,
        fringe=None if rig.water_table is None else rig.water_table.fringe_m,
    )
    check(physics)
    return physics


def check(physics: Physics) -> None:
    """Refuse coefficients that no rig can have.

    Raises:
        InputError: depth, porosity or permeability not finite or not positive, permeability that
            differs too much, porosity above 1, or a well or leak outside the rig; names the field,
            the value and the remedy.
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
    contrast = float(physics.permeability.max()) / float(physics.permeability.min())
    if contrast > MOST_CONTRAST:
        raise InputError(
            f'permeability: it differs by a factor of {contrast:.3g} within the rig, and the flow '
            f'can be solved up to {MOST_CONTRAST:g}; take weaker zones'
        )
    if physics.porosity.max() > 1:
        raise InputError(f'porosity {physics.porosity.max():.6g}: must not exceed 1')
    sources_and_sinks = {f"well '{name}'": well for name, well in physics.wells.items()}
    sources_and_sinks |= {f'leak {n + 1}': leak.source_sink for n, leak in enumerate(physics.leaks)}
    for name, well in sources_and_sinks.items():
        if not (0 < well.x < physics.grid.width and 0 < well.z < physics.grid.height):
            raise InputError(
                f'{name} at ({well.x:.6g}, {well.z:.6g}) m lies outside the rig of '
                f'{physics.grid.width} x {physics.grid.height} m, or on its edge; correct its '
                'position'
            )


def in_and_out(rates: Iterable[float]) -> tuple[float, float]:
    """Return the total inflow and the total outflow of `rates` [m^3/s], both positive."""
    each = list(rates)
    put_in = math.fsum(rate for rate in each if rate > 0.0)
    return put_in, -math.fsum(rate for rate in each if rate < 0.0)
