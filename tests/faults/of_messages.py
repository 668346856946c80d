"""Messages. Data on the network that the twin did not make."""

from typing import Any

import numpy as np

from faults.fault import LogLine, fault
from faults.stage import Stage
from porotwin_core import conversions, qos
from porotwin_core.grid import Grid
from porotwin_core.wells import WellRate
from porotwin_msgs.msg import NewState, StateRefreshed, WellRates

IGNORED = 'Ignores it. No setpoint follows.'
REMOVED = 'the foreign node is gone'


def foreign_state(stage: Stage, values: np.ndarray, *, number: int) -> None:
    """Publish a state as a node would that does not belong to the twin."""
    taken = stage.now()
    nz, nx = values.shape
    grid = Grid(nx, nz, stage.rig.width_m, stage.rig.height_m)
    header = conversions.header_at(taken)
    tracer = conversions.tracer_to_msg(values, grid, taken)
    state = NewState(header=header, sequence=number, time_step=1.0, tracer=tracer)
    stage.publish('asset/new_state', NewState, qos.FIELD, state)
    refreshed = StateRefreshed(header=header, sequence=number)
    stage.publish('asset/state_refreshed', StateRefreshed, qos.FIELD, refreshed)


@fault(
    'A foreign state has another grid.',
    LogLine('hub', 'state 9001 ignored'),
    does=IGNORED,
    mends=REMOVED,
)
def other_grid(stage: Stage) -> None:
    foreign_state(stage, np.zeros((20, 30)), number=9001)


@fault(
    'Measured rates name a well that is not in rig.yaml.',
    LogLine('hub', "well 'elsewhere' is not in rig.yaml"),
    does='Ignores them.',
    mends=REMOVED,
)
def unknown_well(stage: Stage) -> None:
    publish_rates(stage, {'elsewhere': WellRate(1e-8)})


def publish_rates(stage: Stage, rates: dict[str, WellRate]) -> None:
    """Publish measured rates of this moment."""
    header: Any = conversions.header_at(stage.now())
    message = WellRates(header=header, start=header.stamp, wells=conversions.rates_to_msg(rates))
    stage.publish('wells/measured', WellRates, qos.FIELD, message)
