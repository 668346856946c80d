"""Rigs and places of the scenarios of the loop bench, and the experiment of the demo as one."""

from porotwin_cli.running.loop_operator import Operator
from porotwin_cli.running.loop_scenario import PRODUCER_DELIVERY, LoopScenario, PumpFault
from porotwin_core.rig import (
    Boundaries,
    Control,
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
