"""Messages. Data on the network that the twin did not make, and settings out of range."""

import array
import math
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import CompressedImage

from faults.fault import Answer, LogLine, Remark, Status, fault
from faults.stage import ENVIRONMENT, GRID, Stage
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import WellRate
from porotwin_core.ros import conversions, qos
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_msgs.msg import NewState, Setpoint, StateRefreshed, WellRates

REMOVED = 'end the foreign node'
NO_SETPOINT = 'Ignores the state. No setpoint follows while a foreign node sends states.'
NX, NZ = (int(number) for number in GRID.split('x'))


def foreign_state(stage: Stage, values: np.ndarray, *, number: int) -> Iterator[None]:
    """Publish a state as a node does that is not of the twin; that node is gone at the end."""
    taken = time.time()
    nz, nx = values.shape
    header: Any = conversions.header_at(taken)
    tracer = conversions.tracer_to_msg(
        np.zeros(values.shape), Grid(nx, nz, stage.rig.width_m, stage.rig.height_m), taken
    )
    tracer.concentration = values.astype(np.float32).ravel().tolist()
    with (
        stage.foreign('asset/new_state', NewState, qos.FIELD) as send_state,
        stage.foreign('asset/state_refreshed', StateRefreshed, qos.FIELD) as send_refreshed,
    ):
        send_state(NewState(header=header, sequence=number, time_step=1.0, tracer=tracer))
        send_refreshed(StateRefreshed(header=header, sequence=number))
        yield


@fault(
    'A foreign node sends a state on another grid.',
    LogLine('hub', 'state 9001 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def other_grid(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.zeros((20, 30)), number=9001)


@fault(
    'A foreign node sends a state of NaN.',
    LogLine('hub', 'state 9002 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def state_of_nan(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), math.nan), number=9002)


@fault(
    'A foreign node sends a state of infinite numbers.',
    LogLine('hub', 'state 9003 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def state_of_infinity(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), math.inf), number=9003)


@fault(
    'A foreign node sends a state of 1e30.',
    LogLine('hub', 'state 9004 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def huge_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), 1e30), number=9004)


@fault(
    'A foreign node sends a state of -5.',
    LogLine('hub', 'state 9005 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def negative_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), -5.0), number=9005)


@fault(
    'A foreign node sends a state that looks right.',
    Remark('a second node publishes asset/new_state'),
    does='Does not use the state. No setpoint follows while the foreign node is there.',
    mends=REMOVED,
)
def plausible_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.zeros((NZ, NX)), number=9006)


@fault(
    'A foreign node sends a photograph.',
    Status('imaging', 'ERROR', 'several nodes publish camera/image/compressed'),
    does='Leaves out all photographs while the foreign node is there. No setpoint follows.',
    mends=REMOVED,
)
def foreign_photograph(stage: Stage) -> Iterator[None]:
    with stage.foreign('camera/image/compressed', CompressedImage, qos.PHOTO) as send:
        photograph = CompressedImage(header=conversions.header_at(time.time()), format='jpeg')
        photograph.data = array.array('B', stage.picture())
        send(photograph)
        yield


@fault(
    'A foreign node sends a setpoint that keeps all limits.',
    Status('guard', 'ERROR', 'no setpoint can pass'),
    LogLine('operator', 'not shown'),
    does='Operator and pumps refuse the setpoint. No setpoint passes while the foreign node is '
    'there.',
    mends=REMOVED,
)
def foreign_setpoint(stage: Stage) -> Iterator[None]:
    now = time.time()
    message = Setpoint(
        header=conversions.header_at(now),
        sequence=9001,
        valid_until=conversions.time_to_msg(now + 60.0),
        wells=conversions.rates_to_msg(stage.limits.safe()),
    )
    with stage.foreign('wells/setpoint', Setpoint, qos.SETPOINT) as send:
        stage.foreign_setpoints.add(9001)
        send(message)
        yield


@fault(
    'Measured rates name a well that is not in rig.yaml.',
    LogLine('hub', "well 'elsewhere' is not in rig.yaml"),
    does='Ignores these rates.',
    mends='correct the names',
)
def unknown_well(stage: Stage) -> Iterator[None]:
    yield from foreign_rates(stage, {'elsewhere': WellRate(1e-8)})


@fault(
    'Measured rates are in m3/h where m3/s belong.',
    LogLine('hub', 'this rig stands at most'),
    does='Ignores these rates.',
    mends='correct the unit',
)
def wrong_unit_of_rates(stage: Stage) -> Iterator[None]:
    yield from foreign_rates(stage, {'injector': WellRate(5e-4, 1.0)})


def foreign_rates(stage: Stage, rates: dict[str, WellRate]) -> Iterator[None]:
    """Publish measured rates of this moment."""
    header: Any = conversions.header_at(time.time())
    with stage.foreign('wells/measured', WellRates, qos.FIELD) as send:
        wells = conversions.rates_to_msg(rates)
        send(WellRates(header=header, start=header.stamp, wells=wells))
        yield


@fault(
    'A second hub is started in the same domain.',
    Answer('ROS_DOMAIN_ID'),
    does='The second hub ends at once. One line says how to run two.',
    mends='nothing',
)
def second_hub(stage: Stage) -> None:
    command = [sys.executable, '-m', 'porotwin_hub.hub_node', '--ros-args']
    command += ['-r', f'__ns:={NAMESPACE}', '-p', f'rig:={stage.folder / "rig.yaml"}']
    ran = subprocess.run(
        command,
        env={**ENVIRONMENT, 'ROS_DOMAIN_ID': str(stage.domain)},
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == 2, ran.stderr
    assert 'ROS_DOMAIN_ID' in ran.stderr.strip().splitlines()[-1]


@fault(
    'A parameter of the hub is set out of its range while it runs.',
    Answer('it must be'),
    does='Refuses the value with its range, and keeps the old one.',
    mends='set a value within the range',
)
def parameter_out_of_range(stage: Stage) -> None:
    for name, value in (('horizon_s', -5.0), ('evaluations', -3), ('model_timeout_s', math.nan)):
        request = SetParameters.Request()
        request.parameters = [Parameter(name, value=value).to_parameter_msg()]
        (result,) = stage.call(SetParameters, 'hub/set_parameters', request).results
        assert not result.successful
        assert 'it must be' in result.reason, result.reason
