"""One time step of the tracer in the virtual rig: transport, spreading and reactions."""

import math
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.rates.wells import WellRates
from porotwin_rig.box_flow import Fluxes
from porotwin_rig.characteristics import Carrier, arriving, inflow_through_rim
from porotwin_rig.effects import EffectSet
from porotwin_rig.spreading import Spreading, spread
from porotwin_rig.tracer import Tracer, TracerBalance
from porotwin_rig.true_rig import TrueRig
from porotwin_rig.water_flow import WaterFlow

FloatArray = NDArray[np.floating]


class InnerFaces(NamedTuple):
    """Faces between boxes: the flux [m^3/s], and values and canals before and after each."""

    flux: FloatArray
    one: FloatArray
    other: FloatArray
    low: NDArray[np.bool_]
    high: NDArray[np.bool_]


RIM_POINTS = 24
"""Points on the rim of a producing well where the concentration of the water is read."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
GAUSS_POINTS = tuple(zip(0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS, strict=True))
"""Nodes and weights of the four-point Gauss rule on [0, 1]: the tracer that leaves in a step is an
integral over time."""

BESIDE_FACE = 1e-6
"""Distance of a point from the face of a box, in elements, where it is in the box beside."""

BESIDE_TRACER = 1e-3
"""Least concentration near a vertex that counts as next to tracer, relative to the highest."""


class TracerTransport:
    """Time steps of the tracer in a constant rig."""

    def __init__(self, rig: TrueRig, effects: EffectSet) -> None:
        """Prepare steps of `rig`; the reactions of `effects` act in every step."""
        self._rig = rig
        self._mesh = rig.mesh
        self._storage = rig.storage
        self._pore_depth = rig.pore_depth
        self._area = rig.mesh.box_area
        self._places = rig.water_places
        self._volume = np.where(self._places.fixed, 0.0, self._storage * self._area)
        self._spreading = Spreading(
            rig.diffusion, rig.longitudinal_dispersivity, rig.transverse_dispersivity
        )
        self._reactions = [
            (effect.on_tracer, values, effect.removes_tracer)
            for effect, values in effects
            if effect.on_tracer is not None
        ]

    def empty(self) -> Tracer:
        """Return a rig without tracer."""
        return Tracer(self._with_water(np.zeros(self._mesh.shape)), np.zeros(self._mesh.shape))

    def _with_water(self, mobile: FloatArray) -> FloatArray:
        """Return `mobile` with the concentration where the water outside fixes it."""
        return np.where(self._places.fixed, self._places.entering, mobile)

    def dissolved(self, tracer: Tracer) -> FloatArray:
        """Return the mean concentration [-] of all pore water, (nz + 1, nx + 1)."""
        if self._rig.immobile_fraction is None:
            return tracer.mobile
        return self._rig.mobile_fraction * tracer.mobile + tracer.stationary

    def mobile_mass(self, tracer: Tracer) -> float:
        """Return the volume of stock [m^3] that moves with the water or sorbs linearly."""
        return float(np.sum(tracer.mobile * self._volume))

    def total_mass(self, tracer: Tracer) -> float:
        """Return the volume of stock [m^3] in the rig in any form."""
        stationary = tracer.stationary * self._pore_depth * self._area
        return self.mobile_mass(tracer) + float(np.sum(stationary))

    def step(
        self,
        tracer: Tracer,
        balance: TracerBalance,
        *,
        water: WaterFlow,
        rates: WellRates,
        time: float,
        duration: float,
    ) -> tuple[Tracer, TracerBalance]:
        """Return tracer and balance after a step of `duration` [s] from `time` [s] on.

        Reactions act half before and half after the transport (Strang splitting).

        Args:
            tracer: the tracer at `time`.
            balance: its balance since the start.
            water: the flow.
            rates: true rates of all sources and sinks.
            time: time since the start [s].
            duration: length of the step [s].
        """
        fluxes = water.fluxes(rates, tracer.mobile, time + 0.5 * duration)
        carrier = self._carrier(water, fluxes, rates)
        tracer, balance = self._reacted(tracer, balance, 0.5 * duration)
        tracer, balance = self._carried(tracer, balance, carrier, water, fluxes, rates, duration)
        mobile = spread(
            self._mesh,
            tracer.mobile,
            storage=self._storage,
            spreading=self._spreading,
            velocity=self._vertex_velocity(fluxes) if self._spreading.follows_flow else None,
            duration=duration,
        )
        if self._places.fixed.any():
            into_canals = float(np.sum((tracer.mobile - mobile) * self._volume))
            balance = replace(balance, removed=balance.removed + into_canals)
        tracer = tracer._replace(mobile=self._with_water(np.clip(mobile, 0.0, None)))
        return self._reacted(tracer, balance, 0.5 * duration)

    def _reacted(
        self, tracer: Tracer, balance: TracerBalance, duration: float
    ) -> tuple[Tracer, TracerBalance]:
        """Return tracer and balance after all reactions of `duration` [s]."""
        for react, values, removes_tracer in self._reactions:
            after = react(tracer, self._rig, values, duration)
            if removes_tracer:
                decayed = self.total_mass(tracer) - self.total_mass(after)
                balance = replace(balance, decayed=balance.decayed + decayed)
            tracer = after
        return tracer, balance

    def _carrier(self, water: WaterFlow, fluxes: Fluxes, rates: WellRates) -> Carrier:
        """Return the velocities of one step: radial flows of the wells and a remainder."""
        remainder = fluxes
        for name, rate in rates.items():
            remainder = remainder - water.radial[name] * rate.rate
        wells = [
            (*water.places[name], rate.rate, rate.concentration) for name, rate in rates.items()
        ]
        entering = self._places.entering
        if self._rig.background_flux is not None:  # through all walls, without tracer
            entering = np.maximum(entering, 0.0)
        return Carrier(
            hx=self._mesh.hx,
            hz=self._mesh.hz,
            remainder_x=remainder.x / self._mesh.box_height[:, None],
            remainder_z=remainder.z / self._mesh.box_width[None, :],
            storage=self._storage,
            wells=np.array(wells, dtype=float).reshape(-1, 5),
            entering=entering,
            canal=self._places.fixed,
            settling=self._rig.settling_velocity,
        )

    def _carried(
        self,
        tracer: Tracer,
        balance: TracerBalance,
        carrier: Carrier,
        water: WaterFlow,
        fluxes: Fluxes,
        rates: WellRates,
        duration: float,
    ) -> tuple[Tracer, TracerBalance]:
        """Return the tracer carried along the characteristics, its mass corrected at the fronts."""
        x, z = np.meshgrid(self._mesh.x, self._mesh.z)
        field = tracer.mobile
        carried, low, high = arriving(carrier, field, x=x, z=z, duration=np.full(x.shape, duration))
        gained = sum(
            rate.rate * rate.concentration * duration for rate in rates.values() if rate.rate > 0.0
        )
        gained += duration * self._entering(fluxes)
        lost = self._lost_in_wells(field, carrier, water, rates, duration)
        lost += self._lost_through_sides(field, carrier, fluxes, duration)
        lost += self._lost_in_canals(field, carrier, fluxes, duration)
        held = self.mobile_mass(tracer) + gained
        lost = min(lost, held)  # the last tracer may leave between the moments that are counted
        due = held - lost
        highest = max(
            float(field.max()),
            float(self._places.entering.max()),
            *(rate.concentration for rate in rates.values()),
            0.0,
        )
        volume = self._volume
        corrected = with_mass(
            carried, low, high, volume,
            due=due, highest=highest, injected=self._unseen_injection(carrier),
        )  # fmt: skip
        corrected = self._with_water(corrected)
        return tracer._replace(mobile=corrected), replace(
            balance,
            injected=balance.injected + gained,
            removed=balance.removed + lost,
            corrected=balance.corrected + abs(float(np.sum((corrected - carried) * volume))),
        )

    def _unseen_injection(self, carrier: Carrier) -> FloatArray:
        """Return the injected concentration [-] at the vertices around wells, (nz + 1, nx + 1).

        Only wells count whose disc holds no vertex: as long as their plume is smaller than an
        element, no characteristic ends in it.
        """
        found = np.zeros(self._mesh.shape)
        for x, z, radius, rate, concentration in carrier.wells:
            i = min(int(x / self._mesh.hx), self._mesh.nx - 1)
            j = min(int(z / self._mesh.hz), self._mesh.nz - 1)
            corners = np.s_[j : j + 2, i : i + 2]
            distance = np.hypot(
                self._mesh.x[None, i : i + 2] - x, self._mesh.z[j : j + 2, None] - z
            )
            if rate > 0.0 and distance.min() > radius:
                found[corners] = np.maximum(found[corners], concentration)
        return found

    def _lost_in_wells(
        self,
        field: FloatArray,
        carrier: Carrier,
        water: WaterFlow,
        rates: WellRates,
        duration: float,
    ) -> float:
        """Return the volume of stock [m^3] that sinks take out in a step of `duration` [s]."""
        lost = 0.0
        angle = (np.arange(RIM_POINTS) + 0.5) * (2.0 * math.pi / RIM_POINTS)
        for name, rate in rates.items():
            if rate.rate >= 0.0:
                continue
            x, z, radius = water.places[name]
            inflow = np.maximum(inflow_through_rim(carrier, x, z, radius, angle), 0.0)
            share = inflow / inflow.sum()
            for moment, weight in GAUSS_POINTS:
                there, _, _ = arriving(
                    carrier,
                    field,
                    x=x + radius * np.cos(angle),
                    z=z + radius * np.sin(angle),
                    duration=np.full(RIM_POINTS, moment * duration),
                )
                lost -= weight * duration * rate.rate * float(share @ there)
        return lost

    def _lost_through_sides(
        self, field: FloatArray, carrier: Carrier, fluxes: Fluxes, duration: float
    ) -> float:
        """Return the volume of stock [m^3] that leaves with water through open sides."""
        mesh, held = self._mesh, self._places.fixed
        lost = 0.0
        for flow, x, z, fixed in (
            (fluxes.z[-1], mesh.x, np.full(mesh.nx + 1, mesh.height), held[-1]),
            (-fluxes.z[0], mesh.x, np.zeros(mesh.nx + 1), held[0]),
            (fluxes.x[:, -1], np.full(mesh.nz + 1, mesh.width), mesh.z, held[:, -1]),
            (-fluxes.x[:, 0], np.zeros(mesh.nz + 1), mesh.z, held[:, 0]),
        ):
            out = np.maximum(flow, 0.0) * ~fixed
            if not out.any():
                continue
            for moment, weight in GAUSS_POINTS:
                there, _, _ = arriving(
                    carrier, field, x=x, z=z, duration=np.full(x.shape, moment * duration)
                )
                lost += weight * duration * float(np.sum(out * there))
        return lost

    def _entering(self, fluxes: Fluxes) -> float:
        """Return the stock [m^3/s] that water from outside brings through walls and from canals."""
        stock, fixed = np.maximum(self._places.entering, 0.0), self._places.fixed
        if not stock.any():
            return 0.0
        found, through = 0.0, np.where(fixed, 0.0, stock)
        for flow, beside in (
            (-fluxes.z[-1], through[-1]),
            (fluxes.z[0], through[0]),
            (-fluxes.x[:, -1], through[:, -1]),
            (fluxes.x[:, 0], through[:, 0]),
        ):
            found += float(np.sum(np.maximum(flow, 0.0) * beside))
        for flow, one, other, low, high in _inner_faces(fluxes, stock, fixed):
            found += float(np.sum(np.maximum(flow, 0.0) * one * (low & ~high)))
            found += float(np.sum(np.maximum(-flow, 0.0) * other * (high & ~low)))
        return found

    def _lost_in_canals(
        self, field: FloatArray, carrier: Carrier, fluxes: Fluxes, duration: float
    ) -> float:
        """Return the volume of stock [m^3] that flows into canals in a step of `duration` [s]."""
        canal, mesh = self._places.fixed, self._mesh
        if not canal.any():
            return 0.0
        lost = 0.0
        x, z = np.meshgrid(mesh.x, mesh.z)
        middles = (0.5 * (x[:, 1:] + x[:, :-1]), z[:, 1:]), (x[1:], 0.5 * (z[1:] + z[:-1]))
        faces = _inner_faces(fluxes, field, canal)
        for (flow, _, _, low, high), (at_x, at_z), (dx, dz) in zip(
            faces, middles, ((mesh.hx, 0.0), (0.0, mesh.hz)), strict=True
        ):
            for into, sign in ((flow * (high & ~low), -1.0), (-flow * (low & ~high), 1.0)):
                at = into > 0.0
                if not at.any():
                    continue
                for moment, weight in GAUSS_POINTS:
                    there, _, _ = arriving(
                        carrier,
                        field,
                        x=at_x[at] + sign * BESIDE_FACE * dx,
                        z=at_z[at] + sign * BESIDE_FACE * dz,
                        duration=np.full(int(at.sum()), moment * duration),
                    )
                    lost += weight * duration * float(np.sum(into[at] * there))
        return lost

    def _vertex_velocity(self, fluxes: Fluxes) -> tuple[FloatArray, FloatArray]:
        """Return the pore velocity (vx, vz) [m/s] at the vertices."""
        pores = self._pore_depth * self._rig.mobile_fraction
        along_x = 0.5 * (fluxes.x[:, 1:] + fluxes.x[:, :-1]) / self._mesh.box_height[:, None]
        along_z = 0.5 * (fluxes.z[1:] + fluxes.z[:-1]) / self._mesh.box_width[None, :]
        return along_x / pores, along_z / pores


def _inner_faces(
    fluxes: Fluxes, values: FloatArray, canal: NDArray[np.bool_]
) -> tuple[InnerFaces, InnerFaces]:
    """Return for the faces between boxes, along x and z: flux, values and canals on both sides."""
    return (
        InnerFaces(fluxes.x[:, 1:-1], values[:, :-1], values[:, 1:], canal[:, :-1], canal[:, 1:]),
        InnerFaces(fluxes.z[1:-1], values[:-1], values[1:], canal[:-1], canal[1:]),
    )


def with_mass(
    field: FloatArray,
    low: FloatArray,
    high: FloatArray,
    volume: FloatArray,
    *,
    due: float,
    highest: float,
    injected: FloatArray,
) -> FloatArray:
    """Return `field` changed so that sum(field * volume) = `due`, within 0 and `highest`.

    Missing tracer fills the vertices of `injected` first. Then values change within [low, high],
    in proportion to their room. The bounds differ at fronts only, so only fronts change. A
    remainder goes to the vertices beside tracer, then anywhere.

    Args:
        field: carried concentration, (nz + 1, nx + 1).
        low: least value of the interpolation, same shape.
        high: greatest value of the interpolation, same shape.
        volume: storage volume of the boxes [m^3], same shape.
        due: wanted volume of stock [m^3].
        highest: highest concentration in the rig and in the wells.
        injected: concentration around wells whose plume may be smaller than an element, 0
            elsewhere, same shape.
    """
    near_tracer = (high > BESIDE_TRACER * highest).astype(np.uint8)
    beside = np.asarray(cv2.dilate(near_tracer, np.ones((3, 3))), bool)
    for lowest_now, highest_now in (
        (field, injected),
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
