"""The parts that learnt physics is built of, each with a few unknowns."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.units import GRAVITY
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntLeak, LearntPhysics, SandPatch
from porotwin_core.rig import Rig

PATCH_RADIUS = 0.055
"""Radius of a patch before it is fitted, relative to the longer side of the rig."""

PATCH_TRIAL = 1.2
"""Size of the logarithm of the permeability factor that a fit of a patch starts from."""

LEAK_TRIAL = 0.03
"""Rate that a fit of a leak starts from, relative to the strongest pump."""

PLACE_SPACING = 0.065
"""Distance of the places that are tried, relative to the longer side of the rig."""


class LearntUnknown(NamedTuple):
    """A number to be learnt: `origin` + `scale` * u, or its exponential with `log`.

    u has a prior of zero mean and the standard deviation `prior`, and lies within `low`..`high`.
    A step of 1 in u moves a front by about a cell.
    """

    scale: float
    origin: float = 0.0
    prior: float = 20.0
    low: float = -1e3
    high: float = 1e3
    log: bool = False

    def value(self, scaled: float) -> float:
        """Return the number in SI units at the scaled value u."""
        value = self.origin + self.scale * scaled
        return float(np.exp(value)) if self.log else value


ApplyFn = Callable[..., LearntPhysics]
"""(physics, values of the unknowns in SI) -> physics with this part."""


@dataclass(frozen=True)
class PhysicsPart:
    """A part of learnt physics: its unknowns, the start of their fit, and their effect."""

    name: str
    unknowns: tuple[LearntUnknown, ...]
    apply: ApplyFn
    start: tuple[float, ...] = ()

    @property
    def first(self) -> FloatArray:
        """The scaled values at the start of the fit, (unknowns,)."""
        return np.array(self.start or [0.0] * len(self.unknowns), dtype=float)

    def values(self, scaled: FloatArray) -> list[float]:
        """Return the unknowns in SI units at their `scaled` values (unknowns,)."""
        pairs = zip(self.unknowns, scaled, strict=True)
        return [unknown.value(float(u)) for unknown, u in pairs]


def physics_of(parts: Sequence[PhysicsPart], scaled: FloatArray) -> LearntPhysics:
    """Return the physics of all `parts` at the scaled values of their unknowns, in one array."""
    physics, done = LearntPhysics(), 0
    for part in parts:
        end = done + len(part.unknowns)
        physics, done = part.apply(physics, *part.values(scaled[done:end])), end
    return physics


def density(physics: LearntPhysics, difference: float) -> LearntPhysics:
    """Return `physics` with a tracer denser by `difference` [kg/m^3]."""
    return replace(physics, density_difference=physics.density_difference + difference)


def spreading(physics: LearntPhysics, along: float, across: float) -> LearntPhysics:
    """Return `physics` with more dispersivity [m] along and across the flow."""
    return replace(
        physics,
        longitudinal_dispersivity=physics.longitudinal_dispersivity + along,
        transverse_dispersivity=physics.transverse_dispersivity + across,
    )


def drift(physics: LearntPhysics, x: float, z: float) -> LearntPhysics:
    """Return `physics` with more background flux [m/s]."""
    by_x, by_z = physics.background_flux
    return replace(physics, background_flux=(by_x + x, by_z + z))


def sorption(physics: LearntPhysics, logarithm: float) -> LearntPhysics:
    """Return `physics` with the retardation changed by a factor, given as its logarithm."""
    return replace(physics, log_retardation=physics.log_retardation + logarithm)


def leak(physics: LearntPhysics, x: float, z: float, rate: float) -> LearntPhysics:
    """Return `physics` with one more leak at (`x`, `z`) [m] of `rate` [m^3/s]."""
    return replace(physics, leaks=(*physics.leaks, LearntLeak(x, z, rate)))


def patch(
    physics: LearntPhysics, x: float, z: float, radius: float, log_factor: float
) -> LearntPhysics:
    """Return `physics` with one more patch of sand; see `SandPatch`."""
    return replace(physics, patches=(*physics.patches, SandPatch(x, z, radius, log_factor)))


@dataclass(frozen=True)
class PartMaker:
    """Makes parts whose unknowns suit a rig, a grid and experiments.

    `duration` [s] is the length of the longest experiment, `strongest` [m^3/s] the largest rate.
    """

    rig: Rig
    grid: Grid
    duration: float
    strongest: float

    @property
    def size(self) -> float:
        """The longer side of the rig [m]."""
        return max(self.grid.width, self.grid.height)

    def everywhere(self) -> list[PhysicsPart]:
        """Return the parts without a place."""
        porosity = float(np.mean(self.rig.field('porosity', self.grid)))
        permeability = float(np.median(self.rig.field('permeability_m2', self.grid)))
        flux = self.grid.dx * porosity / self.duration
        sinking = flux * self.rig.viscosity_pa_s / (permeability * GRAVITY)
        return [
            PhysicsPart(
                'spreading',
                (LearntUnknown(5e-4, low=0.0), LearntUnknown(1e-4, low=0.0)),
                spreading,
                (1, 1),
            ),
            PhysicsPart('density', (LearntUnknown(2.0 * sinking),), density),
            PhysicsPart('drift', (LearntUnknown(flux), LearntUnknown(flux)), drift),
            PhysicsPart('sorption', (LearntUnknown(0.02),), sorption),
        ]

    def places(self) -> list[tuple[float, float]]:
        """Return the places [m] where a leak or a patch is tried."""
        spacing = PLACE_SPACING * self.size
        columns = max(1, round(self.grid.width / spacing))
        rows = max(1, round(self.grid.height / spacing))
        return [
            ((i + 0.5) * self.grid.width / columns, (j + 0.5) * self.grid.height / rows)
            for j in range(rows)
            for i in range(columns)
        ]

    def leak_at(self, x: float, z: float, sign: float) -> PhysicsPart:
        """Return a leak whose fit starts at (`x`, `z`) [m], as a source or a sink."""
        rate = LearntUnknown(0.005 * self.strongest)
        start = (0.0, 0.0, sign * LEAK_TRIAL * self.strongest / rate.scale)
        return PhysicsPart('leak', (*self._place(x, z), rate), leak, start)

    def patch_at(self, x: float, z: float, sign: float) -> PhysicsPart:
        """Return a patch whose fit starts at (`x`, `z`) [m], more or less permeable by `sign`."""
        radius = LearntUnknown(
            0.1, float(np.log(PATCH_RADIUS * self.size)), prior=5.0, low=-15.0, high=15.0, log=True
        )
        strength = LearntUnknown(0.25, prior=10.0, low=-20.0, high=20.0)
        start = (0.0, 0.0, 0.0, sign * PATCH_TRIAL / strength.scale)
        return PhysicsPart('patch', (*self._place(x, z), radius, strength), patch, start)

    def _place(self, x: float, z: float) -> tuple[LearntUnknown, LearntUnknown]:
        step = 0.0065 * self.size
        width, height = self.grid.width, self.grid.height
        return (
            LearntUnknown(step, x, low=(0.01 * width - x) / step, high=(0.99 * width - x) / step),
            LearntUnknown(step, z, low=(0.01 * height - z) / step, high=(0.99 * height - z) / step),
        )
