"""Scenarios of the closed loop: a rig with a zone to protect, and faults that no twin is told.

`bench_loop_draw` draws them; the demo's experiment is one as well.
"""

import math
from dataclasses import dataclass

from pydantic import ConfigDict

from porotwin_cli.bench_loop_operator import Operator
from porotwin_core.rig import (
    Boundaries,
    Control,
    EffectDescription,
    FixedWell,
    Rig,
    Well,
)

Point = tuple[float, float]

WIDTH_M, HEIGHT_M = 0.934, 0.562
"""Size of the paper's small rig [m]; all scenarios take place in a rig of this size."""

PAPER_PLACES: dict[str, Point] = {
    'injector': (0.235, 0.235),
    'producer': (0.660, 0.160),
    'control1': (0.120, 0.420),
    'control2': (0.500, 0.375),
    'control3': (0.760, 0.460),
}
"""Places of the wells in the paper (x, z) [m]."""

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


def demo_scenario(minutes: float = 80.0) -> LoopScenario:
    """Return the experiment of the paper's section 4, as in `./porotwin demo`."""
    control = Control(
        wells=('control1', 'control2', 'control3'),
        producer='producer',
        fixed={'injector': FixedWell(rate_ml_h=500.0, concentration=1.0)},
        disallowed_zone_m=((0.0, 0.42), (WIDTH_M, 0.30), (WIDTH_M, HEIGHT_M), (0.0, HEIGHT_M)),
    )
    return LoopScenario(
        name='demo',
        rig=plain_rig(PAPER_PLACES, control),
        effects=(),
        faults=(PumpFault('producer', PRODUCER_DELIVERY),),
        meters=True,
        operator=Operator(),
        start=0.0,
        end=60.0 * minutes,
        photo_interval=30.0,
        seed=7,
    )


def plain_rig(places: dict[str, Point], control: Control | None) -> Rig:
    """Return a rig of the paper's size and sand with wells at `places` (x, z) [m]."""
    return Rig(
        name='bench',
        width_m=WIDTH_M,
        height_m=HEIGHT_M,
        depth_m=0.010,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1.0e-3,
        density_kg_m3=998.0,
        boundaries=Boundaries(),
        wells={name: Well(x_m=x, z_m=z) for name, (x, z) in places.items()},
        control=control,
    )
