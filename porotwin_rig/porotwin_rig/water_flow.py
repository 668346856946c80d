"""The water of the virtual rig: fluxes through the boxes for given rates and tracer."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rates.wells import WellRates
from porotwin_rig.box_flow import (
    BoxFlow,
    Fluxes,
    HalfFaces,
    no_flux,
    radial_fluxes,
)
from porotwin_rig.true_rig import TrueRig
from porotwin_rig.wet_sand import WetSand

FloatArray = NDArray[np.floating]


class WaterFlow:
    """Flow in a constant rig; fluxes of unit rates are computed once and kept.

    Attributes:
        places: (x, z, radius) [m] of every source and sink, off the faces of the boxes.
        radial: fluxes of a unit source at each place in an unbounded plane.
        has_open_side: whether water can leave or enter through a side, so that rates need not
            balance.
    """

    def __init__(self, rig: TrueRig) -> None:
        """Prepare the flow in `rig`.

        Raises:
            InputError: water is forced through a rig with a water table in the sand.
        """
        if rig.fringe is not None and (rig.background_flux or rig.table_amplitude):
            raise InputError(
                'water_table: only levels and rain drive the water below a table in the sand; '
                'remove background_flow and the swaying table'
            )
        mesh = rig.mesh
        self._rig = rig
        self._along_x, self._along_z = rig.transmissivity
        water = rig.water_places
        self._held = water.held
        self._flow = BoxFlow(mesh, self._along_x, self._along_z, held=self._held, canal=water.canal)
        self.places = {
            name: (*mesh.off_faces(x, z), radius) for name, (x, z, radius) in rig.places.items()
        }
        self.radial = {name: radial_fluxes(mesh, x, z) for name, (x, z, _) in self.places.items()}
        self.has_open_side = bool(self._held.any())
        self._unit: dict[str, Fluxes] = {}
        self._table: tuple[WellRates, Mapping[str, float], WetSand] | None = None
        self._levels = WaterLevels.of(rig.rig)
        self._per_metre: dict[str, Fluxes] = {}
        self._excess = rig.density_difference / rig.rig.density_kg_m3
        self._heads = water.potential(mesh.z[:, None], self._excess)
        self._rain = water.rain if water.rain.x.any() or water.rain.z.any() else None
        self._background = self._background_fluxes()
        is_driven = self._heads is not None or self._rain is not None
        if is_driven and rig.viscosity_ratio == 1.0:
            self._background += self._flow.combined(
                [], held_potential=self._heads, forced=self._rain
            )
        self._tilt: Fluxes | None = None

    def fluxes(self, rates: WellRates, tracer: FloatArray, time: float) -> Fluxes:
        """Return the fluxes [m^3/s] at `time` [s].

        Args:
            rates: true rates of all sources and sinks.
            tracer: concentration of the mobile water, (nz + 1, nx + 1); its density and viscosity
                act on the flow.
            time: time since the start [s], for levels that change and a table that sways.
        """
        rises = self._levels.at(time)
        if self._rig.fringe is not None:
            return self._below_table(rates, tracer, rises)
        total = self._background
        alone = self._rig.viscosity_ratio == 1.0  # otherwise heads are not in the background
        for name, rise in rises.items() if alone else ():
            total = total + self._fluxes_per_metre(name) * rise
        if self._rig.density_difference == 0.0 and self._rig.viscosity_ratio == 1.0:
            for name, rate in rates.items():
                total = total + self._unit_fluxes(name) * rate.rate
        else:
            total = total + self._coupled_fluxes(rates, tracer, rises)
        return total + self._sway(time)

    def _fluxes_per_metre(self, name: str) -> Fluxes:
        """Return the additional fluxes [m^2/s] for each metre by which the water `name` rises."""
        if name not in self._per_metre:
            raised = self._potential({name: 1.0})
            described = np.zeros_like(raised) if self._heads is None else self._heads
            self._per_metre[name] = self._flow.combined([], held_potential=raised - described)
        return self._per_metre[name]

    def _potential(self, rises: Mapping[str, float]) -> FloatArray:
        """Return the potential of the held vertices [m of water] after the water rose [m]."""
        places = self._rig.at_levels(rises).water_places
        found = places.potential(self._rig.mesh.z[:, None], self._excess)
        return np.zeros(self._rig.mesh.shape) if found is None else found

    def _below_table(
        self, rates: WellRates, tracer: FloatArray, rises: Mapping[str, float]
    ) -> Fluxes:
        """Return the fluxes below the steady table of `rates` and levels; the latest is kept.

        Density and viscosity of the tracer act on the flow, not on the table.
        """
        rig = self._rig
        assert rig.fringe is not None
        if self._table is None or self._table[:2] != (rates, rises):
            table = WetSand(
                rig.mesh,
                (self._along_x, self._along_z),
                rig.at_levels(rises).water_places_on,
                fringe=rig.fringe,
                wells=self._wells_at(rates),
                excess=self._excess,
            )
            self._table = dict(rates), rises, table
        table = self._table[2]
        return self._flowing(table.flow, table.potential, self._rain, rates, tracer)

    def _wells_at(self, rates: WellRates) -> list[tuple[float, float, float]]:
        return [(*self.places[name][:2], rate.rate) for name, rate in rates.items()]

    def _unit_fluxes(self, name: str) -> Fluxes:
        """Return the fluxes of a unit rate at the place `name`."""
        if name not in self._unit:
            x, z, _ = self.places[name]
            self._unit[name] = self._flow.well(x, z)
        return self._unit[name]

    def _coupled_fluxes(
        self, rates: WellRates, c: FloatArray, rises: Mapping[str, float]
    ) -> Fluxes:
        """Return the fluxes where density or viscosity depends on the concentration `c`."""
        alone = self._rig.viscosity_ratio == 1.0  # heads and rain are in the background
        own = self._potential(rises) if rises else self._heads
        heads, rain = (None, None) if alone else (own, self._rain)
        return self._flowing(self._flow, heads, rain, rates, c)

    def _flowing(
        self,
        flow: BoxFlow,
        heads: FloatArray | None,
        rain: Fluxes | None,
        rates: WellRates,
        c: FloatArray,
    ) -> Fluxes:
        """Return the fluxes of `flow` with the concentration `c`, all drives together."""
        ratio, density = self._rig.viscosity_ratio, self._rig.density_difference
        in_elements = 0.25 * (c[:-1, :-1] + c[:-1, 1:] + c[1:, :-1] + c[1:, 1:])
        mobility = ratio**-in_elements
        along_x, along_z = flow.along_x * mobility, flow.along_z * mobility
        driven = None
        if density != 0.0:
            mesh, water = self._rig.mesh, self._rig.rig.density_kg_m3
            pull = -along_z * (density / water) * (0.5 * mesh.hx)
            none = np.zeros_like(pull)
            left_side = 0.5 * (c[:-1, :-1] + c[1:, :-1])
            right_side = 0.5 * (c[:-1, 1:] + c[1:, 1:])
            driven = HalfFaces(
                none,
                none,
                pull * (0.75 * left_side + 0.25 * right_side),
                pull * (0.25 * left_side + 0.75 * right_side),
            )
        return flow.combined(
            self._wells_at(rates),
            held_potential=heads,
            driven=driven,
            forced=rain,
            along=None if ratio == 1.0 else (along_x, along_z),
        )

    def _sway(self, time: float) -> Fluxes:
        """Return the fluxes of the tilted water table: potential on the open sides
        amplitude sin(2 pi t / period) (x / W - 1/2)."""
        rig, mesh = self._rig, self._rig.mesh
        if rig.table_amplitude == 0.0:
            return no_flux(mesh)
        if self._tilt is None:
            slope = np.broadcast_to(mesh.x / mesh.width - 0.5, mesh.shape)
            self._tilt = self._flow.combined([], held_potential=np.where(self._held, slope, 0.0))
        phase = 2.0 * math.pi * time / rig.table_period
        return self._tilt * (rig.table_amplitude * math.sin(phase))

    def _background_fluxes(self) -> Fluxes:
        """Return the fluxes of water that is forced through all four sides.

        The inflow through a side leaves through the opposite one.
        """
        mesh, depth = self._rig.mesh, self._rig.depth
        x_velocity, z_velocity = self._rig.background_flux or (0.0, 0.0)
        forced = no_flux(mesh)
        if x_velocity == 0.0 and z_velocity == 0.0:
            return forced
        forced.x[:, 0] = x_velocity * depth[:, 0] * mesh.box_height
        forced.x[:, -1] = x_velocity * depth[:, -1] * mesh.box_height
        forced.z[0] = z_velocity * depth[0] * mesh.box_width
        forced.z[-1] = z_velocity * depth[-1] * mesh.box_width
        if z_velocity != 0.0:
            forced.z[-1] *= forced.z[0].sum() / forced.z[-1].sum()
        if x_velocity != 0.0:
            forced.x[:, -1] *= forced.x[:, 0].sum() / forced.x[:, -1].sum()
        closed = BoxFlow(mesh, self._along_x, self._along_z, held=np.zeros_like(self._held))
        return closed.through_walls(forced)
