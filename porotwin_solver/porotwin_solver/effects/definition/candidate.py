"""Candidates of a search, and all that they depend on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.fitted_effect import Candidate as Candidate
from porotwin_core.model.fitted_effect import FitParameter as FitParameter
from porotwin_core.rig import Rig


@dataclass(frozen=True)
class SearchContext:
    """A recording as far as search parameters depend on it.

    Args:
        rig: the nominal rig.
        grid: grid of the recorded maps.
        duration: length of the recording [s].
        pumping_wells: names of the wells that pump in the recording.
        strongest_rate: largest absolute rate of a well [m^3/s].
        measures_pressure: whether the recording has readings of pressure.
        well: for an effect of a well, its name.
        tracer_wells: names of the wells that inject tracer.
    """

    rig: Rig
    grid: Grid
    duration: float
    pumping_wells: tuple[str, ...] = ()
    strongest_rate: float = 0.0
    well: str = ''
    tracer_wells: tuple[str, ...] = ()
    measures_pressure: bool = False

    @property
    def front_speed(self) -> float:
        """Speed that moves a front by one cell within the recording [m/s]."""
        return self.grid.dx / self.duration

    @property
    def longer_side(self) -> float:
        """Longer side of the rig [m]."""
        return max(self.rig.width_m, self.rig.height_m)

    @property
    def middle(self) -> tuple[float, float]:
        """Middle (x, z) of the rig [m]."""
        return self.rig.width_m / 2, self.rig.height_m / 2

    @property
    def porosity(self) -> float:
        """Mean porosity on the grid [-]."""
        return float(np.mean(self.rig.field('porosity', self.grid)))

    @property
    def permeability(self) -> float:
        """Mean permeability on the grid [m^2]."""
        return float(np.mean(self.rig.field('permeability_m2', self.grid)))


Candidates = Callable[[SearchContext], Sequence[Candidate]]
"""Returns the candidates of one effect; none where the rig cannot have the effect."""

Beliefs = Callable[[Rig], Sequence[Candidate]]
"""Returns what is believed of an effect before any photograph, on top of `rig.yaml`: u, the number
of steps, is normal with mean 0 and deviation 1. None where the effect is certainly as described."""


TrialsFn = Callable[[SearchContext, tuple[float, float]], Sequence[Candidate]]
"""Returns the candidates that are tried at a place (x, z) [m]."""


@dataclass(frozen=True)
class PlaceSearch:
    """How the place of an effect is found: trials at many places, ranked by projection.

    The strength of a trial is its last parameter. The search multiplies it by the factor that fits
    the residual best, clipped to `strength_factors`, and starts a fit there.

    Args:
        trials: returns the candidates tried at a place (x, z) [m].
        strength_factors: least and greatest factor.
        sized_trials: returns candidates of several sizes for a place (x, z) [m] that another effect
            suggests; None: the same as `trials`.
    """

    trials: TrialsFn
    strength_factors: tuple[float, float]
    sized_trials: TrialsFn | None = None
