"""Physics that a data-driven model has learnt: properties of sand and tracer beyond rig.yaml.

The learnt physics consists of plain numbers. The data-driven model keeps them in a file, and the
solver runs them. Neither of them imports the other.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass
from typing import Any, Self

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid

EDGE = 0.15
"""Width of the edge of a patch relative to its radius [-]: sand is packed in lenses, and an edge
of a cell or two has a slope that a fit can follow."""

LARGEST_LOG_RETARDATION = math.log(100.0)
"""Largest change of the logarithm of the retardation [-]: a tracer a hundred times slower would
not leave its well within an experiment."""

LARGEST_LOG_FACTOR = math.log(1e3)
"""Largest logarithm of the permeability factor of a patch [-]: sands of grains from 0.1 to 3 mm
differ by a factor of 1000, because permeability grows with the square of the grain size (Hazen)."""

LEAST_RADIUS = 1e-3
"""Least radius of a patch of sand [m]: the size of a grain."""


@dataclass(frozen=True)
class LearntLeak:
    """Water that enters at (`x`, `z`) [m] with `rate` [m^3/s]; negative where it is lost."""

    x: float
    z: float
    rate: float


@dataclass(frozen=True)
class SandPatch:
    """A round patch of other sand about (`x`, `z`) [m] with a smooth edge at `radius` [m].

    `log_factor` is the logarithm of its permeability relative to the sand around it [-].
    """

    x: float
    z: float
    radius: float
    log_factor: float


@dataclass(frozen=True)
class LearntPhysics:
    """Changes of the coefficients of flow and transport; all zero means the model as described.

    density_difference: added to the density of the tracer minus that of water [kg/m^3].
    longitudinal_dispersivity, transverse_dispersivity: added to Scheidegger's a_L and a_T [m].
    background_flux: added to the Darcy flux (x, z) through all sides [m/s].
    log_retardation: logarithm of the factor on the retardation [-].
    leaks: unknown sources and sinks of water.
    patches: patches of other sand; where they overlap, their factors multiply.
    """

    density_difference: float = 0.0
    longitudinal_dispersivity: float = 0.0
    transverse_dispersivity: float = 0.0
    background_flux: tuple[float, float] = (0.0, 0.0)
    log_retardation: float = 0.0
    leaks: tuple[LearntLeak, ...] = ()
    patches: tuple[SandPatch, ...] = ()

    def check(self) -> None:
        """Return if every number is finite and within its range.

        Raises:
            InputError: it names the number that is wrong.
        """
        named = {
            'density_difference': self.density_difference,
            'longitudinal_dispersivity': self.longitudinal_dispersivity,
            'transverse_dispersivity': self.transverse_dispersivity,
            'background_flux': self.background_flux,
            'log_retardation': self.log_retardation,
            'leaks': [astuple(leak) for leak in self.leaks],
            'patches': [astuple(patch) for patch in self.patches],
        }
        for name, values in named.items():
            if not np.isfinite(np.asarray(values, dtype=float)).all():
                raise InputError(f'learnt physics, {name}: not a finite number; train again')
        for name in ('longitudinal_dispersivity', 'transverse_dispersivity'):
            if getattr(self, name) < 0.0:
                raise InputError(
                    f'learnt physics, {name} {getattr(self, name):g} m: '
                    'must not be negative; train again'
                )
        _refuse_beyond('log_retardation', self.log_retardation, LARGEST_LOG_RETARDATION)
        for patch in self.patches:
            _refuse_beyond('patches, log_factor', patch.log_factor, LARGEST_LOG_FACTOR)
            if patch.radius < LEAST_RADIUS:
                raise InputError(
                    f'learnt physics, patches: a radius of {patch.radius:g} m is less than a '
                    f'grain, {LEAST_RADIUS:g} m; train again'
                )

    def permeability_factor(self, grid: Grid) -> FloatArray:
        """Return the factor on the permeability of every cell, (nz, nx)."""
        logarithm = np.zeros(grid.shape)
        for patch in self.patches:
            distance = np.hypot(grid.x[None, :] - patch.x, grid.z[:, None] - patch.z)
            inside = 0.5 * (1.0 - np.tanh((distance / patch.radius - 1.0) / EDGE))
            logarithm += patch.log_factor * inside
        factor: FloatArray = np.exp(logarithm)
        return factor

    def description(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        return asdict(self)

    @classmethod
    def from_description(cls, values: Mapping[str, Any]) -> Self:
        """Return the physics in a description as JSON keeps it.

        Raises:
            KeyError, TypeError: an entry is missing or unknown.
        """
        x, z = values['background_flux']
        return cls(
            **{
                **values,
                'background_flux': (float(x), float(z)),
                'leaks': tuple(LearntLeak(**leak) for leak in values['leaks']),
                'patches': tuple(SandPatch(**patch) for patch in values['patches']),
            }
        )


def _refuse_beyond(name: str, value: float, largest: float) -> None:
    if abs(value) > largest:
        raise InputError(
            f'learnt physics, {name} {value:g}: must lie between {-largest:.3g} and {largest:.3g}; '
            'train again'
        )


NO_LEARNT_PHYSICS = LearntPhysics()
"""The model as it is described."""
