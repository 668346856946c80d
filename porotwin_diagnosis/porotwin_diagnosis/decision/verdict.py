"""The verdict on a recording: its record, and verdicts that are not names of effects."""

from dataclasses import dataclass
from enum import StrEnum

from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.thresholds import LEAST_RIVAL
from porotwin_solver.effects import effects_of
from porotwin_solver.effects.definition.effect import Scope

NONE, UNEXPLAINED = 'none', 'unexplained'
"""Verdicts without an effect: there is no gap; there is a gap that no effect explains."""

NUMERICAL = effects_of(Scope.MODEL)[0].name
"""Name of the effect that the configured scheme has by smearing fronts."""


class Doubt(StrEnum):
    """The least certain statement in a verdict. Its log-odds set the confidence."""

    NO_GAP = 'no gap'
    CALIBRATION = 'calibration'
    RIVAL = 'rival'
    REMAINDER = 'remainder'
    FEWER = 'fewer'
    START = 'start'
    SCANT = 'scant'
    UNTRIED = 'untried'


@dataclass(frozen=True)
class Verdict:
    """The conclusion from a recording about the model. Only `verdict_rules.decide` makes one.

    Attributes:
        name: `NONE`, `UNEXPLAINED`, `NUMERICAL`, or the name of the strongest effect.
        confidence: probability of the verdict (see `confidence`).
        model: the kept fit; for `NONE` and `NUMERICAL` the model without effects.
        members: names of the effects that are named, the strongest first.
        inseparable: other effects that look the same as the first member.
        probabilities: probability of every effect alone, by name, and of `NONE`.
        alternatives: other combinations that look the same as the members.
        close: other effects that look different, but explain the recording nearly as well. The
            confidence is not theirs.
        doubt: the least certain statement in the verdict.
        rival: effects of the most probable other explanation, `(NONE,)` for no effect; empty if
            there is none.
    """

    name: str
    confidence: float
    model: Fit
    members: tuple[str, ...]
    inseparable: tuple[str, ...]
    probabilities: dict[str, float]
    alternatives: tuple[tuple[str, ...], ...] = ()
    close: tuple[str, ...] = ()
    doubt: Doubt = Doubt.REMAINDER
    rival: tuple[str, ...] = ()

    @property
    def not_separable(self) -> tuple[str, ...]:
        """Names of all other effects that the recording cannot tell from the first member."""
        return (*self.inseparable, *self.close)

    @property
    def kept(self) -> bool:
        """Whether the verdict names a cause of a gap."""
        return self.name not in (NONE, UNEXPLAINED)

    @property
    def stands_alone(self) -> bool:
        """Whether a single effect is named, and no other effect is probable."""
        no_rivals = (self.name, NONE)
        rivals = (share for name, share in self.probabilities.items() if name not in no_rivals)
        return len(self.members) == 1 and max(rivals, default=1.0) < LEAST_RIVAL
