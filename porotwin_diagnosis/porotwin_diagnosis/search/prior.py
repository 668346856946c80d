"""The belief about the effects of a rig before a recording of it is searched.

Earlier recordings of the rig make this belief (`rig_history.prior_from`). It decides between
effects that the new recording cannot separate.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from porotwin_core.rig import EffectDescription
from porotwin_solver.effects import EFFECTS

PERSISTENCE = 0.9
"""Probability that a cause is still there, with the same size, when the next recording is made."""

DRIFT = 0.1
"""Change of a value from one recording to the next that is no surprise, relative to the value."""

NO_EFFECT = 'none'
"""Name under which a belief holds the probability that nothing is missing."""

ValueKey = tuple[str, str, str]
"""Effect, well (empty: none) and parameter of a believed value."""


@dataclass(frozen=True)
class Prior:
    """What is believed before a recording is searched; empty: nothing.

    Attributes:
        probabilities: probability [-] of every effect alone by name, and of `NO_EFFECT`.
        values: value and standard deviation of every known parameter, in its unit.
    """

    probabilities: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[ValueKey, tuple[float, float]] = field(default_factory=dict)

    def weight(self, effects: Sequence[EffectDescription]) -> float:
        """Return the prior probability of `effects`, one or none; only ratios matter.

            w = s p exp(-z^2 / 2) + (1 - s) / n

        s is `PERSISTENCE`, p the believed probability, n the number of effects in the library, and
        z^2 the squared distances of the parameters from the believed values, in deviations.
        """
        if not self.probabilities:
            return 1.0
        name = effects[0].name if effects else NO_EFFECT
        distance = self._distance(effects[0]) if effects else 0.0
        lasting = self.probabilities.get(name, 0.0) * math.exp(-0.5 * distance)
        return PERSISTENCE * lasting + (1.0 - PERSISTENCE) / (len(EFFECTS) + 1)

    def _distance(self, effect: EffectDescription) -> float:
        """Return the sum of squared distances from the believed values, in deviations."""
        well = str(effect.parameters.get('well', ''))
        total = 0.0
        for parameter, value in effect.parameters.items():
            believed = self.values.get((effect.name, well, parameter))
            if believed is None or isinstance(value, str):
                continue
            mean, deviation = believed
            total += (value - mean) ** 2 / max(deviation**2 + (DRIFT * mean) ** 2, 1e-300)
        return total


NO_PRIOR = Prior()
"""No earlier recording is known."""
