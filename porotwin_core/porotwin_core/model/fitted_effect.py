"""Effects with unknown parameters: for searches and for priors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from porotwin_core.rig import EffectDescription

PRIOR_STEPS = 10.0
"""Prior deviation of a parameter whose effect may be missing, in its natural steps [-]. With 20, as
COSTA had, squared errors of unseen runs of eight virtual rigs differ by at most 0.5 %."""

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
    def prior_deviation(self) -> float:
        """Prior deviation where the effect may be missing [steps]: PRIOR_STEPS or half the range.

        `believed` of an effect is narrower: it says how far a rig lies from its description.
        """
        low, high = self.range
        return min(PRIOR_STEPS, 0.5 * (high - low))

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
    fixed: Mapping[str, float | str] = field(default_factory=dict)
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
