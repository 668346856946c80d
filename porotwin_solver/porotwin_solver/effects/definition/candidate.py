"""Candidates of a search: the parameters of an effect with natural steps, ranges and starts."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import EffectDescription, Rig

LARGEST_EXPONENT = 60.0
"""Bound of the exponent of a logarithmic parameter: exp(60) is far beyond every range, and exp does
not overflow."""


@dataclass(frozen=True)
class FitParameter:
    """A parameter and its scaled form u: value = neutral + step u, or neutral exp(step u).

    Args:
        name: name of the parameter.
        unit: unit of its value, of `neutral`, `step`, `low` and `high`.
        neutral: value at u = 0; the value without effect, unless `is_never_absent`.
        step: natural step, without unit if `log`; u = 1 changes the maps by about the noise.
        low: least value.
        high: greatest value.
        log: the second form holds.
    """

    name: str
    unit: str
    neutral: float
    step: float
    low: float = -math.inf
    high: float = math.inf
    log: bool = False

    def value(self, scaled: float) -> float:
        """Return the value [`unit`] at `scaled` steps, clipped to the range."""
        if self.log:
            exponent = min(max(self.step * scaled, -LARGEST_EXPONENT), LARGEST_EXPONENT)
            return float(np.clip(self.neutral * math.exp(exponent), self.low, self.high))
        return float(np.clip(self.neutral + self.step * scaled, self.low, self.high))

    def scaled(self, value: float) -> float:
        """Return u [-], the number of steps at which the parameter is `value`, without clipping."""
        if self.log:
            return math.log(value / self.neutral) / self.step
        return (value - self.neutral) / self.step

    @property
    def range(self) -> tuple[float, float]:
        """Least and greatest number of steps."""
        low = -math.inf if self.log and self.low <= 0 else self.scaled(self.low)
        return low, self.scaled(self.high)

    @property
    def is_never_absent(self) -> bool:
        """Whether the parameter is a positive strength, which no number of steps makes zero."""
        return self.log and self.neutral != 1.0

    @property
    def absent(self) -> float:
        """Value without effect, in the unit of the parameter."""
        return 0.0 if self.is_never_absent else self.neutral


@dataclass(frozen=True)
class Candidate:
    """An effect to be fitted.

    Args:
        effect: name of the effect.
        parameters: the fitted parameters.
        fixed: values of the other parameters, in their units.
        starts: scaled parameters [-] where a fit may start; all zero if there are none.
        variant: tells candidates of one effect apart that fit different parameters.
        tied: parameters that are a share of a fitted one: its name and the share [-].
    """

    effect: str
    parameters: tuple[FitParameter, ...]
    fixed: dict[str, float | str] = field(default_factory=dict)
    starts: tuple[tuple[float, ...], ...] = ()
    variant: str = ''
    tied: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """A name that no other candidate of a search has."""
        parts = [self.effect, str(self.fixed.get('well', '')), self.variant]
        return ' '.join(filter(None, parts))

    def described(self, scaled: Sequence[float]) -> EffectDescription:
        """Return the effect at `scaled`, one number per fitted parameter."""
        values = {k.name: k.value(t) for k, t in zip(self.parameters, scaled, strict=True)}
        tied = {name: share * values[fitted] for name, (fitted, share) in self.tied.items()}
        return EffectDescription(name=self.effect, parameters={**self.fixed, **values, **tied})

    def is_absent(self, scaled: Sequence[float]) -> bool:
        """Return whether the effect at `scaled` is known to change nothing."""
        return not any(scaled) and not any(k.is_never_absent for k in self.parameters)

    @property
    def first(self) -> tuple[float, ...]:
        """The first start, in steps; without effect where the effect allows that."""
        return self.starts[0] if self.starts else (0.0,) * len(self.parameters)


@dataclass(frozen=True)
class SearchContext:
    """A recording as far as search parameters depend on it.

    Args:
        rig: the nominal rig.
        grid: grid of the recorded maps.
        duration: length of the recording [s].
        pumping_wells: names of the wells that pump in the recording.
        strongest_rate: largest absolute rate of a well [m^3/s].
        well: for an effect of a well, its name.
    """

    rig: Rig
    grid: Grid
    duration: float
    pumping_wells: tuple[str, ...] = ()
    strongest_rate: float = 0.0
    well: str = ''

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
        is_rate_at_a_well: at a well the effect cannot be told from a wrong rate of that well.
        sized_trials: returns candidates of several sizes for a place (x, z) [m] that another effect
            suggests; None: the same as `trials`.
    """

    trials: TrialsFn
    strength_factors: tuple[float, float]
    is_rate_at_a_well: bool = False
    sized_trials: TrialsFn | None = None
