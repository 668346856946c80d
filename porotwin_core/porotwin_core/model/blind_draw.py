"""Random parameters of effects for the blind check, scaled to the rig and to the recording.

The strengths make a gap of about 0.1 to 0.35 in relative L2 norm. They follow the size of the rig
and the length of the recording, so that an effect shows as clearly on a large rig over hours as on
a small one within one hour.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from porotwin_core.basis.units import GRAVITY
from porotwin_core.rig import Rig, Well

SMALL_WIDTH_M = 0.934
"""Width of the paper's small rig [m]; strengths, frames and charts were chosen for this rig."""

DrawnValues = dict[str, float | str]
"""Parameters of one effect by name, in the units of the effect."""


@dataclass(frozen=True)
class DrawContext:
    """Where effects are drawn.

    Args:
        rig: the nominal rig.
        wells: names of the wells that pump, the injector first.
        duration: length of the recording [s].
        injected_ml_h: commanded rate of the injector [ml/h].
    """

    rig: Rig
    wells: tuple[str, ...]
    duration: float
    injected_ml_h: float

    @property
    def size(self) -> float:
        """Width of the rig relative to the paper's small one."""
        return self.rig.width_m / SMALL_WIDTH_M

    @property
    def injector(self) -> Well:
        """The well that injects the tracer."""
        return self.rig.wells[self.wells[0]]

    @property
    def sinking(self) -> float:
        """Density difference [kg/m3] that moves tracer by one metre within the recording.

        1 / (duration * k g / (mu phi)), k the geometric mean of the permeability.
        """
        permeability = float(np.exp(np.mean(np.log(self.rig.nominal_map('permeability_m2')))))
        speed = permeability * GRAVITY / (self.rig.viscosity_pa_s * self.porosity)
        return 1.0 / (speed * self.duration)

    @property
    def porosity(self) -> float:
        """Mean porosity [-]."""
        return float(np.mean(self.rig.nominal_map('porosity')))


Draw = Callable[[Generator, DrawContext], DrawnValues]
"""Returns random parameters of one effect."""


def log_uniform(generator: Generator, low: float, high: float) -> float:
    """Return exp(u) with u uniform between log(low) and log(high), in the unit of `low`."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def random_sign(generator: Generator) -> float:
    """Return 1 or -1, equally likely."""
    return 1.0 if generator.random() < 0.5 else -1.0


def factor_off_one(generator: Generator, low: float, high: float) -> float:
    """Return 1 + d or 1 - d with d log-uniform between `low` and `high`."""
    return 1.0 + random_sign(generator) * log_uniform(generator, low, high)


def displacement(generator: Generator, context: DrawContext) -> DrawnValues:
    """Return `dx`, `dz` [m]: 1.5 to 6 mm each way on the small rig."""
    return {
        axis: random_sign(generator) * log_uniform(generator, 1.5e-3, 6e-3) * context.size
        for axis in ('dx', 'dz')
    }


def place_near_injector(generator: Generator, context: DrawContext) -> tuple[float, float]:
    """Return a place (x, z) [m] near the injector, where tracer will pass."""
    rig, well = context.rig, context.injector
    angle = generator.uniform(0, 2 * np.pi)
    distance = generator.uniform(0.07, 0.16) * context.size
    edge = 0.05 * context.size
    x = float(np.clip(well.x_m + distance * np.cos(angle), edge, rig.width_m - edge))
    z = float(np.clip(well.z_m + distance * np.sin(angle), edge, rig.height_m - edge))
    return x, z
