"""Physics that a data-driven model has learnt: properties of sand and tracer beyond rig.yaml.

The learnt physics consists of plain numbers. The data-driven model keeps them in a file, and the
solver runs them. Neither of them imports the other.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, astuple, dataclass
from typing import Any, Self

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.effect_limits import MOST_LEAK_ML_H

EDGE = 0.15
"""Width of the edge of a patch relative to its radius [-]: sand is packed in lenses, and an edge
of a cell or two has a slope that a fit can follow."""

Range = tuple[float, float]

DENSITY_RANGE: Range = (-1000.0, 1000.0)
"""Of the learnt density difference [kg/m^3]: no tracer is heavier than twice the water."""

DISPERSIVITY_RANGE: Range = (0.0, 1.0)
"""Of the learnt dispersivities [m], which are added: a laboratory rig is a few metres wide."""

FLUX_RANGE: Range = (-0.01, 0.01)
"""Of the learnt background flux [m/s]: it would cross a rig in a minute or two."""

LOG_RETARDATION_RANGE: Range = (-4.6, 4.6)
"""Of the logarithm of the learnt retardation [-]: factors of 0.01 to 100."""

LOG_FACTOR_RANGE: Range = (-10.0, 10.0)
"""Of the logarithm of a patch's permeability [-]: from gravel to silt; a fit stays within 5."""

LEAK_RANGE: Range = (from_ml_h(-MOST_LEAK_ML_H), from_ml_h(MOST_LEAK_ML_H))
"""Of the rate of a learnt leak [m^3/s]: a step of the solver with far more would not end."""

RADIUS_RANGE: Range = (1e-3, 10.0)
"""Of the radius of a patch [m]: from a grain of sand to a rig that is larger than any."""


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

    density_difference: added to the density difference of tracer and water [kg/m^3].
    longitudinal_dispersivity, transverse_dispersivity: added to Scheidegger's a_L and a_T [m].
    background_flux: added to the Darcy flux (x, z) through all sides [m/s].
    log_retardation: logarithm of the factor on the retardation [-].
    leaks: unknown sources and sinks of water.
    patches: patches of other sand; where they overlap, their factors multiply.
    scheme: name of a sharper numerical scheme for single steps; empty: the scheme of the model.
        It belongs to the model, not to the sand: models over longer times keep their own.
    """

    density_difference: float = 0.0
    longitudinal_dispersivity: float = 0.0
    transverse_dispersivity: float = 0.0
    background_flux: tuple[float, float] = (0.0, 0.0)
    log_retardation: float = 0.0
    leaks: tuple[LearntLeak, ...] = ()
    patches: tuple[SandPatch, ...] = ()
    scheme: str = ''

    def check(self) -> None:
        """Check that every number is finite and within the range that any rig can have.

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
        along_and_across = (self.longitudinal_dispersivity, self.transverse_dispersivity)
        _check_range('density_difference', [self.density_difference], DENSITY_RANGE)
        _check_range('dispersivity', along_and_across, DISPERSIVITY_RANGE)
        _check_range('background_flux', self.background_flux, FLUX_RANGE)
        _check_range('log_retardation', [self.log_retardation], LOG_RETARDATION_RANGE)
        _check_range('rate of a leak', [one.rate for one in self.leaks], LEAK_RANGE)
        _check_range('radius of a patch', [one.radius for one in self.patches], RADIUS_RANGE)
        factors = [one.log_factor for one in self.patches]
        _check_range('log_factor of a patch', factors, LOG_FACTOR_RANGE)

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


def _check_range(name: str, values: Iterable[float], within: Range) -> None:
    """Check that all `values` lie `within` a range.

    Raises:
        InputError: one does not.
    """
    low, high = within
    for value in values:
        if not low <= value <= high:
            raise InputError(
                f'learnt physics, {name}: {value:g} is not from {low:g} to {high:g}; train again'
            )


NO_LEARNT_PHYSICS = LearntPhysics()
"""The model as it is described."""
