"""Clocks. The clock of this machine is set while the twin runs."""

import time
from collections.abc import Iterator

from faults.fault import Remark, Status, fault
from faults.stage import Stage, encoded, decoded

HOURS_S = 7200
"""Two hours [s]: far beyond the validity of a setpoint."""

MINUTE_S = 60
"""A minute [s]: less than the validity of a setpoint."""

KEEPS = (
    'Tells by how much. Ages and waits go on by a clock that nobody sets. Control continues. '
    'Records and logs carry the new time.'
)
RESTART = 'nothing at once; start the twin again after the experiment, so that all clocks agree'


def _told(ahead: str) -> Status:
    return Status('supervisor', 'WARN', f'clock of this machine was set {ahead}')


@fault('The clock of this machine is set two hours ahead.', _told('ahead by 2:00:00'), does=KEEPS, mends=RESTART)
def clock_ahead(stage: Stage) -> Iterator[None]:
    stage.clock.ahead_s = HOURS_S
    stage.wait_for_control()
    yield


@fault('The clock of this machine is set two hours back.', _told('back by 2:00:00'), does=KEEPS, mends=RESTART)
def clock_back(stage: Stage) -> Iterator[None]:
    stage.clock.ahead_s = -HOURS_S
    stage.wait_for_control()
    yield


@fault('Back in one day.', _told('back by 2:00:00'), does=KEEPS, mends=RESTART)
def clock_noexif(stage: Stage) -> Iterator[None]:
    stage.clock.ahead_s = -HOURS_S
    for _ in range(3):
        stage.put(encoded(decoded(stage.picture())), good=True, taken=time.time())
        time.sleep(8)
    print(stage.graph.log('camera')[-2000:])
    stage.wait_for_control()
    yield
