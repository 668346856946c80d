"""The virtual rig: an independent stand-in for the physical asset, in steps of any length."""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_rig.characteristics import Carrier, arriving
from porotwin_rig.effects import IMAGE, OUTSIDE_IMAGE, Effects
from porotwin_rig.flow import (
    BoxFlow,
    Fluxes,
    HalfFaces,
    held_vertices,
    no_flux,
    radial_fluxes,
)
from porotwin_rig.mesh import Mesh
from porotwin_rig.pumps import Pumps, true_rate_factor
from porotwin_rig.sand import true_sand
from porotwin_rig.sorption import dissolved_in_equilibrium
from porotwin_rig.spreading import Spreading, spread

FloatArray = NDArray[np.floating]

LEAK = 'leak'
"""Name under which water lost or gained at an unknown place is balanced beside the wells."""

_STEP_LIMITS: Mapping[str, float] = MappingProxyType(
    {
        'buoyancy': 15.0,
        'viscosity': 15.0,
        'dispersion': 7.5,
        'dual_porosity': 15.0,
        'freundlich': 5.0,
        'settling': 30.0,
        'water_table': 30.0,
        'pulsation': 15.0,
        'pump_drift': 30.0,
    }
)
"""Longest step [s] of the splitting for effects that change the flow or act beside it."""

_RING = 24
"""Points on the rim of a producing well where its tracer is read."""

_GAUSS = ((0.069432, 0.173927), (0.330009, 0.326073), (0.669991, 0.326073), (0.930568, 0.173927))


class VirtualRig:
    """A sand-filled tank with wells, simulated by numerics of its own.

    Flow: box method on vertices with analytic wells (`flow`). Transport: characteristics with
    quintic interpolation (`characteristics`), made conservative by a correction at the fronts,
    then diffusion or dispersion by super time stepping (`spreading`).

    Args:
        rig: the rig as its owner believes it to be; its own `effects` are beliefs, not the truth.
        effects: what the asset truly does beside it, see `effects.KNOWN`.
        pumps: what the pumps deliver of what they are told.
        cell: about the size of an element [m]; 2.1 mm on the small rig by default.

    Raises:
        InputError: an effect, a parameter or a well is not known, a value is impossible, or a
            well or the leak lies outside the rig.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        effects: Iterable[EffectDescription] = (),
        pumps: Pumps | None = None,
        cell: float | None = None,
    ) -> None:
        self.rig = rig
        self.effects = Effects(effects, rig)
        self.pumps = pumps or Pumps()
        self.mesh = Mesh.over(rig, cell=cell)
        self.time = 0.0
        self._told: dict[str, WellRate] = {}
        self._measured: dict[str, WellRate] = {}
        self._sand = true_sand(rig, self.mesh, self.effects)
        self._held = held_vertices(self.mesh, rig.boundaries)
        self._flow = BoxFlow(self.mesh, self._sand.along_x, self._sand.along_z, held=self._held)
        self._places = self._true_places()
        self._radial = {
            name: radial_fluxes(self.mesh, x, z) for name, (x, z, _) in self._places.items()
        }
        self._unit: dict[str, Fluxes] = {}
        self._background = self._background_fluxes()
        self._tilt: Fluxes | None = None
        number = self.effects.number
        self._mobile_share = 1.0 - number('dual_porosity', 'immobile_fraction')
        self._storage = (
            self._sand.pore_depth * self._mobile_share * number('retardation', 'retardation_factor')
        )
        self._spreading = Spreading(
            number('dispersion', 'diffusion'),
            number('dispersion', 'longitudinal_dispersivity'),
            number('dispersion', 'transverse_dispersivity'),
        )
        self._mobile: FloatArray = np.zeros(self.mesh.shape)
        self._beside: FloatArray = np.zeros(self.mesh.shape)  # immobile or sorbed, per pore volume
        self._signal: FloatArray = np.zeros(self.mesh.shape)  # a stain that lags behind the tracer
        self.injected = 0.0
        self.removed = 0.0
        self.decayed = 0.0
        self.corrected = 0.0

    # --- what the rig offers to the outside -------------------------------------------------

    def set_rates(self, rates: WellRates) -> None:
        """Tell the pumps `rates` from now on; wells that are not named stop.

        Raises:
            InputError: a well is not known, or a rig without open side would have to swell.
        """
        for name in rates:
            if name not in self.rig.wells:
                raise InputError(
                    f"rate for an unknown well '{name}'; known: {', '.join(self.rig.wells)}"
                )
        self._told = dict(rates)

    def told_rates(self) -> dict[str, WellRate]:
        """Return what the pumps were last told."""
        return dict(self._told)

    def measured_rates(self) -> dict[str, WellRate]:
        """Return what the flow meters showed during the last `advance`."""
        return dict(self._measured)

    def advance(self, duration: float) -> None:
        """Let `duration` [s] pass with the rates that were set."""
        if not duration >= 0.0:
            raise InputError(f'advance by {duration} s: give a duration of zero or more')
        self._measured = self.pumps.measured(self._told)
        limit = min(
            (step for name, step in _STEP_LIMITS.items() if name in self.effects), default=math.inf
        )
        steps = max(1, math.ceil(duration / limit - 1e-9)) if duration > 0.0 else 0
        for _ in range(steps):
            self._step(duration / steps)

    def concentration(self, grid: Grid) -> FloatArray:
        """Return what a perfect camera would see, the pore water's tracer, on `grid` (nz, nx).

        The mean over all water in the pores of each cell, mobile or not; sorbed tracer is
        invisible. Conservative: its sum with the pore volumes is the rig's dissolved tracer.
        """
        return self.mesh.to_grid(self.visible(), self._sand.pore_depth, grid)

    def visible(self) -> FloatArray:
        """Return what a perfect camera would see at the mesh's vertices (nz + 1, nx + 1)."""
        if self.effects.number('stain', 'delay') > 0.0:
            return self._signal
        return self._dissolved()

    def mobile_mass(self) -> float:
        """Return the volume of stock [m^3] that moves with the water or sorbs linearly."""
        return float(np.sum(self._mobile * self._storage * self.mesh.box_area))

    def total_mass(self) -> float:
        """Return the volume of stock [m^3] in the rig, in whatever form."""
        beside = self._beside * self._sand.pore_depth * self.mesh.box_area
        return self.mobile_mass() + float(np.sum(beside))

    # --- set-up -----------------------------------------------------------------------------

    def _true_places(self) -> dict[str, tuple[float, float, float]]:
        """Return (x, z, radius) [m] of every well, where it truly opens, and of the leak."""
        places = {
            name: (well.x_m, well.z_m, well.radius_m) for name, well in self.rig.wells.items()
        }
        for moved in self.effects.all('well_position'):
            x, z, radius = places[str(moved['well'])]
            places[str(moved['well'])] = (x + float(moved['dx']), z + float(moved['dz']), radius)
        for leak in self.effects.all('leak'):
            places[LEAK] = (float(leak['x']), float(leak['z']), 0.004)
        for name, (x, z, _) in places.items():
            if not (0.0 < x < self.rig.width_m and 0.0 < z < self.rig.height_m):
                raise InputError(
                    f"'{name}' at ({x:.6g}, {z:.6g}) m lies outside the rig of "
                    f'{self.rig.width_m} x {self.rig.height_m} m; correct its effect'
                )
        return {
            name: (*self.mesh.off_faces(x, z), radius) for name, (x, z, radius) in places.items()
        }

    def _background_fluxes(self) -> Fluxes:
        x_velocity = self.effects.number('background_flow', 'x_velocity')
        z_velocity = self.effects.number('background_flow', 'z_velocity')
        if x_velocity == 0.0 and z_velocity == 0.0:
            return no_flux(self.mesh)
        depth, forced = self._sand.depth, no_flux(self.mesh)
        forced.x[:, 0] = x_velocity * depth[:, 0] * self.mesh.box_height
        forced.x[:, -1] = x_velocity * depth[:, -1] * self.mesh.box_height
        forced.z[0] = z_velocity * depth[0] * self.mesh.box_width
        forced.z[-1] = z_velocity * depth[-1] * self.mesh.box_width
        if z_velocity != 0.0:
            forced.z[-1] *= forced.z[0].sum() / forced.z[-1].sum()
        if x_velocity != 0.0:
            forced.x[:, -1] *= forced.x[:, 0].sum() / forced.x[:, -1].sum()
        closed = BoxFlow(
            self.mesh, self._sand.along_x, self._sand.along_z, held=np.zeros_like(self._held)
        )
        return closed.through_walls(forced)

    # --- one step ---------------------------------------------------------------------------

    def _step(self, duration: float) -> None:
        rates = self._true_rates(duration)
        fluxes = self._fluxes(rates)
        carrier = self._carrier(fluxes, rates)
        self._react(0.5 * duration)
        self._carry(carrier, fluxes, rates, duration)
        self._mobile = np.clip(
            spread(
                self.mesh,
                self._mobile,
                storage=self._storage,
                spreading=self._spreading,
                velocity=self._vertex_velocity(fluxes) if self._spreading.follows_flow else None,
                duration=duration,
            ),
            0.0,
            None,
        )
        self._react(0.5 * duration)
        delay = self.effects.number('stain', 'delay')
        if delay > 0.0:
            share = -math.expm1(-duration / delay)
            self._signal = self._signal + share * (self._dissolved() - self._signal)
        self.time += duration

    def _dissolved(self) -> FloatArray:
        if 'dual_porosity' in self.effects:
            return self._mobile_share * self._mobile + self._beside
        return self._mobile

    def _true_rates(self, duration: float) -> dict[str, WellRate]:
        """Return what truly passes each well in this step, with the leak as a well of its own."""
        rates = {
            name: WellRate(
                rate.rate
                * true_rate_factor(self.effects, name, start=self.time, end=self.time + duration),
                rate.concentration,
            )
            for name, rate in self._measured.items()
            if rate.rate != 0.0
        }
        for leak in self.effects.all('leak'):
            rates[LEAK] = WellRate(from_ml_h(float(leak['rate'])))
        if not self._held.any():
            rates = _balanced(rates)
        return rates

    def _fluxes(self, rates: WellRates) -> Fluxes:
        """Return the water's fluxes [m^3/s] for the rates and the tracer of this moment."""
        density = self.effects.number('buoyancy', 'density_difference')
        ratio = self.effects.number('viscosity', 'viscosity_ratio')
        if density == 0.0 and ratio == 1.0:
            total = self._background
            for name, rate in rates.items():
                total = total + self._unit_fluxes(name) * rate.rate
        else:
            total = self._background + self._coupled_fluxes(rates, density, ratio)
        return total + self._swaying()

    def _unit_fluxes(self, name: str) -> Fluxes:
        if name not in self._unit:
            x, z, _ = self._places[name]
            self._unit[name] = self._flow.well(x, z)
        return self._unit[name]

    def _coupled_fluxes(self, rates: WellRates, density: float, ratio: float) -> Fluxes:
        """Return fluxes where the tracer's density or viscosity acts back on the flow."""
        c = self._mobile
        in_elements = 0.25 * (c[:-1, :-1] + c[:-1, 1:] + c[1:, :-1] + c[1:, 1:])
        thinning = ratio**-in_elements
        along_x, along_z = self._sand.along_x * thinning, self._sand.along_z * thinning
        driven = None
        if density != 0.0:
            pull = -along_z * (density / self.rig.density_kg_m3) * (0.5 * self.mesh.hx)
            none = np.zeros_like(pull)
            left, right = 0.5 * (c[:-1, :-1] + c[1:, :-1]), 0.5 * (c[:-1, 1:] + c[1:, 1:])
            driven = HalfFaces(
                none, none, pull * (0.75 * left + 0.25 * right), pull * (0.25 * left + 0.75 * right)
            )
        return self._flow.combined(
            [(*self._places[name][:2], rate.rate) for name, rate in rates.items()],
            driven=driven,
            along=None if ratio == 1.0 else (along_x, along_z),
        )

    def _swaying(self) -> Fluxes:
        amplitude = self.effects.number('water_table', 'amplitude')
        if amplitude == 0.0:
            return no_flux(self.mesh)
        if self._tilt is None:
            slope = np.broadcast_to(self.mesh.x / self.mesh.width - 0.5, self.mesh.shape)
            self._tilt = self._flow.combined([], held_potential=np.where(self._held, slope, 0.0))
        period = self.effects.number('water_table', 'period')
        return self._tilt * (amplitude * math.sin(2.0 * math.pi * self.time / period))

    def _carrier(self, fluxes: Fluxes, rates: WellRates) -> Carrier:
        remainder = fluxes
        for name, rate in rates.items():
            remainder = remainder - self._radial[name] * rate.rate
        wells = [
            (*self._places[name], rate.rate, rate.concentration) for name, rate in rates.items()
        ]
        sides = self.rig.boundaries
        through = 'background_flow' in self.effects
        return Carrier(
            hx=self.mesh.hx,
            hz=self.mesh.hz,
            remainder_x=remainder.x / self.mesh.box_height[:, None],
            remainder_z=remainder.z / self.mesh.box_width[None, :],
            storage=self._storage,
            wells=np.array(wells, dtype=float).reshape(-1, 5),
            open_sides=np.array(
                [through or side == 'open' for side in (sides.left, sides.right, sides.bottom)]
                + [through or sides.top == 'open']
            ),
            settling=self.effects.number('settling', 'velocity'),
        )

    def _carry(self, carrier: Carrier, fluxes: Fluxes, rates: WellRates, duration: float) -> None:
        """Carry the mobile tracer along, then mend its mass at the fronts."""
        x, z = np.meshgrid(self.mesh.x, self.mesh.z)
        field = self._mobile
        carried, low, high = arriving(carrier, field, x=x, z=z, duration=np.full(x.shape, duration))
        gained = sum(
            rate.rate * rate.concentration * duration for rate in rates.values() if rate.rate > 0.0
        )
        lost = self._lost_in_wells(carrier, rates, duration)
        lost += self._lost_through_sides(carrier, fluxes, duration)
        due = self.mobile_mass() + gained - lost
        highest = max(float(field.max()), *(rate.concentration for rate in rates.values()), 0.0)
        mended = _with_mass(
            carried, low, high, self._storage * self.mesh.box_area, due=due, highest=highest
        )
        self._mobile = mended
        self.injected += gained
        self.removed += lost
        self.corrected += abs(
            float(np.sum((mended - carried) * self._storage * self.mesh.box_area))
        )

    def _lost_in_wells(self, carrier: Carrier, rates: WellRates, duration: float) -> float:
        """Return the volume of stock [m^3] that producing wells take out in this step."""
        lost = 0.0
        angle = (np.arange(_RING) + 0.5) * (2.0 * math.pi / _RING)
        for name, rate in rates.items():
            if rate.rate >= 0.0:
                continue
            x, z, radius = self._places[name]
            for when, weight in _GAUSS:
                there, _, _ = arriving(
                    carrier,
                    self._mobile,
                    x=x + radius * np.cos(angle),
                    z=z + radius * np.sin(angle),
                    duration=np.full(_RING, when * duration),
                )
                lost -= weight * duration * rate.rate * float(there.mean())
        return lost

    def _lost_through_sides(self, carrier: Carrier, fluxes: Fluxes, duration: float) -> float:
        """Return the volume of stock [m^3] that leaves with water through open sides."""
        mesh = self.mesh
        lost = 0.0
        for flow, x, z in (
            (fluxes.z[-1], mesh.x, np.full(mesh.nx + 1, mesh.height)),
            (-fluxes.z[0], mesh.x, np.zeros(mesh.nx + 1)),
            (fluxes.x[:, -1], np.full(mesh.nz + 1, mesh.width), mesh.z),
            (-fluxes.x[:, 0], np.zeros(mesh.nz + 1), mesh.z),
        ):
            out = np.maximum(flow, 0.0)
            if not out.any():
                continue
            for when, weight in _GAUSS:
                there, _, _ = arriving(
                    carrier, self._mobile, x=x, z=z, duration=np.full(x.shape, when * duration)
                )
                lost += weight * duration * float(np.sum(out * there))
        return lost

    def _vertex_velocity(self, fluxes: Fluxes) -> tuple[FloatArray, FloatArray]:
        """Return the pore velocity (vx, vz) [m/s] at the vertices."""
        pores = self._sand.pore_depth * self._mobile_share
        along_x = 0.5 * (fluxes.x[:, 1:] + fluxes.x[:, :-1]) / self.mesh.box_height[:, None]
        along_z = 0.5 * (fluxes.z[1:] + fluxes.z[:-1]) / self.mesh.box_width[None, :]
        return along_x / pores, along_z / pores

    def _react(self, duration: float) -> None:
        """Let dissolved tracer fade, exchange with resting water, or sorb, in place."""
        rate = self.effects.number('decay', 'rate')
        if rate > 0.0:
            before = self.total_mass()
            kept = math.exp(-rate * duration)
            self._mobile = self._mobile * kept
            if 'dual_porosity' in self.effects:
                self._beside = self._beside * kept
            self.decayed += before - self.total_mass()
        if 'dual_porosity' in self.effects:
            self._exchange(duration)
        if 'freundlich' in self.effects:
            self._sorb()

    def _exchange(self, duration: float) -> None:
        """Exchange with immobile water: d c_im/dt = w (c - c_im), the sum kept."""
        immobile = self.effects.number('dual_porosity', 'immobile_fraction')
        if immobile <= 0.0:
            return
        rate = self.effects.number('dual_porosity', 'exchange_rate')
        retarded = self._mobile_share * self.effects.number('retardation', 'retardation_factor')
        resting = self._beside / immobile
        total = retarded * self._mobile + self._beside
        level = total / (retarded + immobile)
        kept = math.exp(-rate * duration * (retarded + immobile) / retarded)
        difference = (self._mobile - resting) * kept
        self._mobile = level + difference * (immobile / (retarded + immobile))
        self._beside = immobile * (self._mobile - difference)

    def _sorb(self) -> None:
        """Bring dissolved and sorbed tracer into equilibrium: sorbed = capacity c^exponent."""
        capacity = self.effects.number('freundlich', 'capacity')
        exponent = self.effects.number('freundlich', 'exponent')
        total = self._mobile + self._beside
        self._mobile = dissolved_in_equilibrium(total, capacity, exponent)
        self._beside = total - self._mobile


def image_effects() -> frozenset[str]:
    """Return the names of the effects that a camera applies, not the rig."""
    return frozenset((*IMAGE, *OUTSIDE_IMAGE)) - {'stain'}


def _balanced(rates: dict[str, WellRate]) -> dict[str, WellRate]:
    """Return rates of a closed rig: what is taken out follows what is put in.

    Sand and water do not give way, so a pump that would take more, or less, finds its pressure
    changed until it does not.
    """
    put_in = math.fsum(rate.rate for rate in rates.values() if rate.rate > 0.0)
    taken = -math.fsum(rate.rate for rate in rates.values() if rate.rate < 0.0)
    if put_in == 0.0 or taken == 0.0:
        return {name: WellRate(0.0, rate.concentration) for name, rate in rates.items()}
    return {
        name: rate if rate.rate >= 0.0 else WellRate(rate.rate * put_in / taken, rate.concentration)
        for name, rate in rates.items()
    }


def _with_mass(
    field: FloatArray,
    low: FloatArray,
    high: FloatArray,
    volume: FloatArray,
    *,
    due: float,
    highest: float,
) -> FloatArray:
    """Return `field` changed so that sum(field * volume) is `due`, within 0 and `highest`.

    Only where neighbours differ is there room within [low, high]: the change goes to the fronts, in
    proportion to it. What does not fit there goes to the vertices beside tracer, then anywhere.
    """
    beside = np.asarray(cv2.dilate((high > 1e-3 * highest).astype(np.uint8), np.ones((3, 3))), bool)
    for lowest_now, highest_now in (
        (low, high),
        (low, high),
        (np.where(beside, 0.0, field), np.where(beside, highest, field)),
        (np.zeros_like(field), np.maximum(field, highest)),
    ):
        missing = due - float(np.sum(field * volume))
        room = np.maximum((highest_now - field) if missing > 0.0 else (field - lowest_now), 0.0)
        held = float(np.sum(room * volume))
        if held > 0.0:
            field = field + math.copysign(min(abs(missing) / held, 1.0), missing) * room
    return field
