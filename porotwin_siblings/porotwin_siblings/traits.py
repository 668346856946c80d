"""The traits of a sibling, its beliefs beyond rig.yaml, and the unknowns behind them."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from porotwin_core.basis.units import GRAVITY, HOUR_S
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.delivered_rates import RATE_DEVIATION
from porotwin_core.rig import EffectDescription, Rig
from porotwin_siblings.diagnosed_effects import DiagnosedEffect

POROSITY_DEVIATION = 0.04
"""Standard deviation of the log of the factor on the porosity [-]."""

DISPERSIVITY_M = 4e-4
DISPERSIVITY_DEVIATION = 1.2
"""Median longitudinal dispersivity [m], about a grain, and the deviation of its logarithm [-]."""

MOST_DISPERSIVITY_M = 0.05
"""Largest longitudinal dispersivity of a sibling [m], four deviations above the median. Photographs
that contradict the rates would lead to kilometres, and a course with them does not end."""

TRANSVERSE_SHARE = 0.1
"""Transverse dispersivity over the longitudinal one (Bear, Dynamics of Fluids in Porous Media)."""

SINKING_M_H = 0.03
"""Standard deviation of how far the tracer sinks or rises by its density in an hour [m]."""

DRIFT_M_H = 0.006
"""Standard deviation of how far water drifts beside the wells in an hour, each way [m]."""

CONDUCTIVITY_DEVIATION = 0.3
"""Standard deviation of the log of the hydraulic conductivity of all the sand, where heads drive
water. Wells alone drive the same flow in any sand."""

LEVEL_DEVIATION_M = 1e-3
"""Standard deviation of the difference between two water levels [m]: a ruler on a wet glass."""

WAVES = tuple(wave for wave in itertools.product(range(4), range(3)) if 0 < wave[0] + wave[1] <= 3)
"""Half waves along x and z of the cosines that change the permeability: half waves of 1/3 of the
rig and above; smaller scales bend the plume little."""

RESERVOIRS = 'flow between reservoirs'
"""Name of the unknown of rigs whose heads drive water."""

COMMON_UNKNOWNS = 6 + len(WAVES)
"""Unknowns of every rig, beside the rates of its wells."""

WAVE_DEVIATION = 0.25
"""Standard deviation of the log permeability in one wave of the longest kind [-]."""


@dataclass(frozen=True)
class Traits:
    """The beliefs of one sibling about the rig.

    rate_factors: delivered rate over commanded rate by well [-].
    longitudinal_dispersivity: [m], on top of the one of rig.yaml.
    density_difference: of tracer stock and water [kg/m^3], on top of the one of rig.yaml.
    porosity_factor: [-].
    background_flux: Darcy flux (x, z) beside the wells [m/s].
    permeability_factor: of all the sand, where heads drive water [-].
    waves: log permeability in each of `WAVES` [-].
    photograph_error: systematic error of the photographs, in standard deviations [-].
    effects: diagnosed effects, drawn within their intervals.
    """

    rate_factors: Mapping[str, float]
    longitudinal_dispersivity: float = 0.0
    density_difference: float = 0.0
    porosity_factor: float = 1.0
    background_flux: tuple[float, float] = (0.0, 0.0)
    permeability_factor: float = 1.0
    waves: tuple[float, ...] = ()
    photograph_error: float = 0.0
    effects: tuple[EffectDescription, ...] = ()


@dataclass(frozen=True)
class Unknown:
    """One number that the siblings disagree on: normal before any photograph.

    `mean` and `deviation` are in the unit of the unknown; factors are unknown by their logarithm.
    """

    name: str
    mean: float
    deviation: float


@dataclass(frozen=True)
class Unknowns:
    """All unknowns of a rig in their order, and the way from numbers to traits."""

    wells: tuple[str, ...]
    listed: tuple[Unknown, ...]
    diagnosed: tuple[DiagnosedEffect, ...] = ()

    @classmethod
    def of(cls, rig: Rig, diagnosed: Sequence[DiagnosedEffect] = ()) -> 'Unknowns':
        """Return the unknowns of `rig` and of effects that a diagnosis found."""
        porosity = float(np.mean(rig.nominal_map('porosity')))
        permeability = float(np.exp(np.mean(np.log(rig.nominal_map('permeability_m2')))))
        # sinking speed [m/s] of 1 kg/m3
        sinking = permeability * GRAVITY / (rig.viscosity_pa_s * porosity)
        drift = DRIFT_M_H / HOUR_S * porosity
        wells = sorted(rig.wells)  # so that their order in rig.yaml changes no draw
        listed = [
            *(Unknown(f'rate {well}', 0.0, RATE_DEVIATION) for well in wells),
            Unknown('dispersivity', float(np.log(DISPERSIVITY_M)), DISPERSIVITY_DEVIATION),
            Unknown('density', 0.0, SINKING_M_H / HOUR_S / sinking),
            Unknown('porosity', 0.0, POROSITY_DEVIATION),
            Unknown('drift x', 0.0, drift),
            Unknown('drift z', 0.0, drift),
            Unknown('photograph', 0.0, 1.0),
            *_of_reservoirs(rig),
            *(Unknown(f'wave {i} {j}', 0.0, WAVE_DEVIATION / max(i, j)) for i, j in WAVES),
            *(
                Unknown(f'{effect.name} {one.name}', one.mean, one.deviation)
                for effect in diagnosed
                for one in effect.numbers
            ),
        ]
        return cls(tuple(wells), tuple(listed), tuple(diagnosed))

    @property
    def mean(self) -> FloatArray:
        """The mean of every unknown before any photograph, (unknowns,)."""
        return np.array([unknown.mean for unknown in self.listed])

    @property
    def deviation(self) -> FloatArray:
        """The standard deviation of every unknown before any photograph, (unknowns,)."""
        return np.array([unknown.deviation for unknown in self.listed])

    @property
    def has_reservoirs(self) -> bool:
        """Whether the flow between reservoirs is an unknown."""
        return any(unknown.name == RESERVOIRS for unknown in self.listed)

    def index(self, name: str) -> int:
        """Return the place of the unknown `name`."""
        return [unknown.name for unknown in self.listed].index(name)

    def traits(self, values: FloatArray) -> Traits:
        """Return the traits for `values` of all unknowns, (unknowns,)."""
        count, rest = len(self.wells), iter(values[len(self.wells) :])
        factors = np.exp(values[:count])
        dispersivity, density, porosity, drift_x, drift_z, photograph = itertools.islice(rest, 6)
        through = next(rest) if self.has_reservoirs else 0.0
        waves = tuple(float(value) for value in itertools.islice(rest, len(WAVES)))
        return Traits(
            rate_factors=dict(zip(self.wells, map(float, factors), strict=True)),
            longitudinal_dispersivity=float(np.exp(min(dispersivity, np.log(MOST_DISPERSIVITY_M)))),
            density_difference=float(density),
            porosity_factor=float(np.exp(porosity)),
            background_flux=(float(drift_x), float(drift_z)),
            permeability_factor=float(np.exp(through)),
            waves=waves,
            photograph_error=float(photograph),
            effects=tuple(effect.described(rest) for effect in self.diagnosed),
        )


def _of_reservoirs(rig: Rig) -> list[Unknown]:
    """Return the unknown of a rig whose heads drive water: how much flows between its reservoirs.

    Maps show conductivity times fall only, so that both are one factor on the conductivity.
    """
    if not rig.is_driven:
        return []
    heads = [body.head_m for body in rig.water_bodies.values() if body.head_m is not None]
    level = LEVEL_DEVIATION_M / (max(heads) - min(heads) or rig.height_m)
    return [Unknown(RESERVOIRS, 0.0, float(np.hypot(CONDUCTIVITY_DEVIATION, level)))]
