"""The belief about the effects of a rig before a recording of it is searched.

Earlier recordings of the rig make this belief (`history.joint_belief.prior_from`). It decides
between effects that the new recording cannot separate.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.ranking import simplicity
from porotwin_solver.effects import EFFECTS

PERSISTENCE = 0.9
"""Probability that a cause is still there, with the same size, when the next recording is made."""

DRIFT = 0.1
"""Change of a value from one recording to the next that is no surprise, relative to its distance
from no effect: a pump at 0.85 of its rate may be at 0.835 or 0.865 next time."""


@dataclass(frozen=True)
class BelievedCause:
    """A cause that earlier recordings have shown.

    Attributes:
        effect: name of the effect.
        well: its well; empty if it has none.
        values: value and standard deviation of every known parameter, in its unit.
    """

    effect: str
    well: str
    values: Mapping[str, tuple[float, float]]

    def distance(self, effect: EffectDescription) -> float:
        """Return the sum of squared distances of the parameters of `effect`, in deviations."""
        total = 0.0
        for parameter, value in effect.parameters.items():
            believed = self.values.get(parameter)
            if believed is None or isinstance(value, str):
                continue
            mean, deviation = believed
            neutral = EFFECTS[self.effect].parameters[parameter].neutral
            drift = DRIFT * (mean - neutral)
            total += (value - mean) ** 2 / max(deviation**2 + drift**2, 1e-300)
        return total


@dataclass(frozen=True)
class Prior:
    """What is believed before a recording is searched; empty: nothing.

    Attributes:
        probabilities: probability [-] of every effect alone by name.
        causes: the causes that were found; one effect may come at several wells or places.
    """

    probabilities: Mapping[str, float] = field(default_factory=dict)
    causes: Sequence[BelievedCause] = ()

    def weight(self, effects: Sequence[EffectDescription]) -> float:
        """Return the prior probability of `effects`, one or none; only ratios matter.

            w = s p exp(-z^2 / 2) + (1 - s) / n

        s is `PERSISTENCE`, p the believed probability, n the number of effects in the library, and
        z^2 the squared distances of the parameters from the believed values, in deviations.
        """
        if not self.probabilities:
            return 1.0
        library = sum(effect.is_diagnosed for effect in EFFECTS.values())
        lasting = sum(
            self.probabilities.get(effect.name, 0.0) * math.exp(-0.5 * self._distance(effect))
            for effect in effects
        )
        return PERSISTENCE * lasting + (1.0 - PERSISTENCE) / (library + 1)

    def belief(self, fit: Fit) -> float:
        """Return the weight [-] of a single effect before its misfit is seen: w times 0.5^p.

        w is the `weight` of its effects, and p the number of its parameters.
        """
        return self.weight(fit.effects) * simplicity(fit)

    def _distance(self, effect: EffectDescription) -> float:
        """Return the squared distance from the nearest believed cause; 0 if none is believed."""
        well = str(effect.parameters.get('well', ''))
        believed = [
            cause.distance(effect)
            for cause in self.causes
            if (cause.effect, cause.well) == (effect.name, well)
        ]
        return min(believed, default=0.0)


NO_PRIOR = Prior()
"""No earlier recording is known."""
