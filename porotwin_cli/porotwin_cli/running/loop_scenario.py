"""A scenario of the closed loop: a rig with a zone to protect, and faults that no twin is told."""

import math
from dataclasses import dataclass

from pydantic import ConfigDict

from porotwin_cli.running.loop_operator import Operator
from porotwin_core.rig import EffectDescription, Rig

PRODUCER_DELIVERY = 0.99
"""Share of its commanded rate that the producer's pump delivers (paper, section 4)."""


@dataclass(frozen=True)
class PumpFault:
    """A pump that delivers a `share` of its rate, from `start` to `end` [s]; 0: nothing.

    A pause of the injection is one of the injector's pump.
    """

    __pydantic_config__ = ConfigDict(ser_json_inf_nan='constants')  # a fault may have no end

    well: str
    share: float
    start: float = 0.0
    end: float = math.inf

    def __str__(self) -> str:
        """Return the fault in words."""
        if self.share > 0.0:
            return f'{self.well} at {self.share:.2f}'
        return f'{self.well} stops' if math.isinf(self.end) else f'{self.well} pauses'


@dataclass(frozen=True)
class LoopScenario:
    """An experiment with a zone to protect, and its secrets.

    Attributes:
        name: of the scenario, such as `scenario_03`.
        rig: the nominal rig with its control section, which the twin knows.
        effects: hidden effects of the rig.
        faults: hidden faults of the pumps.
        meters: whether flow meters report the delivered rates; without them the twin knows the
            rates that the operator confirms.
        operator: the person at the pumps.
        start: when the twin takes over [s]; the safe rates hold before.
        end: end of the experiment [s].
        photo_interval: time between photographs [s].
        seed: of the photographs, their noise and the operator.
    """

    name: str
    rig: Rig
    effects: tuple[EffectDescription, ...]
    faults: tuple[PumpFault, ...]
    meters: bool
    operator: Operator
    start: float
    end: float
    photo_interval: float
    seed: int

    @property
    def describes(self) -> str:
        """Zone, wells and secrets of the scenario in words."""
        assert self.rig.control is not None
        control = self.rig.control
        parts = [
            f'{control.objective.name}, {len(control.wells)} control wells',
            *(effect.name for effect in self.effects),
            *dict.fromkeys(map(str, self.faults)),
            str(self.operator),
        ]
        return ', '.join(parts)
