"""Messages. Data on the network that the twin did not make, and settings out of range."""

import array
import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.parameter import Parameter
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import String

from faults.fault import Answer, LogLine, Remark, Status, fault
from faults.stage import GRID, Stage, kill
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import WellRate
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.foreign_words import FEW
from porotwin_core.ros.senders import SENDERS
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_msgs.msg import CycleReport, NewState, Setpoint, StateRefreshed, WellRates
from porotwin_msgs.srv import Cancel, Control, Predict
from porotwin_recording.experiment.bag import read_bag
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.topic_names import DOUBTFUL

REMOVED = 'end the foreign node'
NO_SETPOINT = 'Ignores the state. No setpoint follows while another node sends states.'
FORGED = 5e-8
"""A rate that the rig can have [m^3/s]."""

NX, NZ = (int(number) for number in GRID.split('x'))


def foreign_state(
    stage: Stage, values: np.ndarray, *, number: int, name: str = 'imaging'
) -> Iterator[None]:
    """Publish a state as the node `name`, by default a second imaging; it is gone at the end."""
    taken = time.time()
    nz, nx = values.shape
    header: Any = conversions.header_at(taken)
    tracer = conversions.tracer_to_msg(
        np.zeros(values.shape), Grid(nx, nz, stage.rig.width_m, stage.rig.height_m), taken
    )
    tracer.concentration = values.astype(np.float32).ravel().tolist()
    with (
        stage.foreign('asset/new_state', NewState, qos.FIELD, name=name) as send_state,
        stage.foreign(
            'asset/state_refreshed', StateRefreshed, qos.FIELD, name=name
        ) as send_refreshed,
    ):
        send_state(
            NewState(
                header=header,
                sequence=number,
                time_step=conversions.duration_to_msg(1.0),
                tracer=tracer,
            )
        )
        send_refreshed(StateRefreshed(header=header, sequence=number))
        yield


@fault(
    'A second imaging sends a state on another grid.',
    LogLine('hub', 'state 9001 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def other_grid(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.zeros((20, 30)), number=9001)


@fault(
    'A second imaging sends a state of NaN.',
    LogLine('hub', 'state 9002 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def state_of_nan(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), math.nan), number=9002)


@fault(
    'A second imaging sends a state of infinite numbers.',
    LogLine('hub', 'state 9003 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def state_of_infinity(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), math.inf), number=9003)


@fault(
    'A second imaging sends a state of 1e30.',
    LogLine('hub', 'state 9004 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def huge_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), 1e30), number=9004)


@fault(
    'A second imaging sends a state of -5.',
    LogLine('hub', 'state 9005 ignored'),
    does=NO_SETPOINT,
    mends=REMOVED,
)
def negative_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.full((NZ, NX), -5.0), number=9005)


@fault(
    'A replay beside the twin sends a state that looks right, and ends.',
    LogLine('hub', 'asset/new_state ignored'),
    does='A twin in real time takes nothing from a recording.',
    mends='end the replay',
)
def replayed_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.zeros((NZ, NX)), number=9007, name='player')


@fault(
    'A foreign node sends a state that looks right.',
    Status('hub', 'WARN', 'publishes asset/new_state too'),
    LogLine('page', 'publishes asset/new_state too'),
    does='No node uses a state, and no setpoint follows meanwhile.',
    mends=REMOVED,
)
def plausible_state(stage: Stage) -> Iterator[None]:
    yield from foreign_state(stage, np.zeros((NZ, NX)), number=9006, name='stranger')


@fault(
    'A foreign node sends a photograph.',
    Status('imaging', 'ERROR', 'publishes camera/image/compressed too'),
    does='Leaves out all photographs meanwhile. No setpoint follows.',
    mends=REMOVED,
)
def foreign_photograph(stage: Stage) -> Iterator[None]:
    with stage.foreign('camera/image/compressed', CompressedImage, qos.PHOTO) as send:
        photograph = CompressedImage(header=conversions.header_at(time.time()), format='jpeg')
        photograph.data = array.array('B', stage.picture())
        send(photograph)
        yield


@fault(
    'Imaging starts again while a foreign node publishes a baseline.',
    Status('imaging', 'ERROR', 'publishes camera/baseline/compressed too'),
    does='Leaves out all baselines, and takes the true one when the foreign node has gone.',
    mends=REMOVED,
)
def foreign_baseline(stage: Stage) -> Iterator[None]:
    photograph = CompressedImage(header=conversions.header_at(time.time()), format='jpeg')
    photograph.data = array.array('B', stage.picture())
    with stage.foreign('camera/baseline/compressed', CompressedImage, qos.BASELINE) as send:
        send(photograph)
        kill(stage, 'imaging')
        yield


@fault(
    'A foreign node sends a setpoint that keeps all limits.',
    Status('guard', 'ERROR', 'no setpoint can pass'),
    LogLine('operator', 'wells/setpoint ignored'),
    LogLine('page', 'wells/setpoint ignored'),
    does='No node uses the setpoint, and none passes meanwhile.',
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
    'A foreign node publishes texts on topics of the twin.',
    LogLine('recorder', 'carries std_msgs/msg/String too'),
    does='Goes on, for the texts reach nobody who waits for setpoints, states or photographs.',
    mends=REMOVED,
)
def other_type(stage: Stage) -> Iterator[None]:
    context = Context()
    rclpy.init(context=context, domain_id=stage.domain)
    node = rclpy.create_node('stranger', namespace=NAMESPACE, context=context)
    publishers = [node.create_publisher(String, topic, qos.CONFIG) for topic in SENDERS]
    for publisher in publishers:
        publisher.publish(String(data='10 ml/h'))
    yield
    stage.wait_for_control()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


@fault(
    'A program publishes setpoints and leaves at once, again and again.',
    LogLine('operator', 'wells/setpoint ignored'),
    LogLine('page', 'wells/setpoint ignored'),
    does='No node uses a setpoint of it.',
    mends='end the program',
)
def brief_setpoints(stage: Stage) -> None:
    for number in range(9011, 9013):
        stage.foreign_setpoints.add(number)
        now = time.time()
        with stage.foreign('wells/setpoint', Setpoint, qos.SETPOINT) as send:
            send(
                Setpoint(
                    header=conversions.header_at(now),
                    sequence=number,
                    valid_until=conversions.time_to_msg(now + 60.0),
                    wells=conversions.rates_to_msg(stage.limits.safe()),
                    reason='brief',
                )
            )
    assert 'brief' not in stage.graph.log('operator')


@fault(
    'A program calls the guard and the pumps and leaves at once, again and again.',
    LogLine('guard', 'setpoint 9021 refused'),
    LogLine('operator', 'setpoint 9021 refused'),
    does='Refuses what the hub and the guard do not know of. No pump moves.',
    mends='end the program',
)
def brief_calls(stage: Stage) -> None:
    now = time.time()
    setpoint = Setpoint(
        header=conversions.header_at(now),
        sequence=9021,
        valid_until=conversions.time_to_msg(now + 60.0),
        wells=conversions.rates_to_msg(stage.limits.safe()),
    )
    for name in ('guard/control', 'asset/control'):
        for _ in range(3):
            stage.call_and_leave(Control, name, Control.Request(setpoint=setpoint))


@fault(
    'Measured rates come from a foreign node.',
    LogLine('hub', 'publishes wells/measured too'),
    Remark('publishes wells/measured too'),
    does='Uses no measured rates meanwhile. Forecasts go by the setpoints.',
    mends=REMOVED,
)
def forged_rates(stage: Stage) -> Iterator[None]:
    rates = foreign_rates(stage, {'injector': WellRate(5e-8, 1.0)}, name='stranger')
    next(rates)
    stage.good_photograph()
    yield
    next(rates, None)


@fault(
    'A program publishes measured rates and leaves at once, again and again.',
    LogLine('recorder', 'wells/measured set aside'),
    does='No node uses them, and no reader of the recording does.',
    mends='end the program',
)
def brief_rates(stage: Stage) -> None:
    for _ in range(2):
        for _ in foreign_rates(stage, {'injector': WellRate(FORGED, 1.0)}, name='stranger'):
            pass

    def aside() -> bool:
        return any(DOUBTFUL in name for name in BagReader(stage.folder / 'bag').topics)

    stage.wait_for('the rates in the recording', aside)
    measured = read_bag(stage.folder / 'bag').measured
    assert measured is None or all(row.rate.rate != FORGED for row in measured.rows)


@fault(
    'A foreign node floods /diagnostics with errors that look like orders.',
    LogLine('supervisor', 'says: "\\x1b[2Jsetpoint 777'),
    LogLine('supervisor', 'more lines of nodes that are not of the twin'),
    does='Shows a few of them in one line each, with the alleged sender, and the number of the '
    'others. No character acts on the terminal.',
    mends=REMOVED,
)
def order_in_an_error(stage: Stage) -> Iterator[None]:
    before = len(stage.graph.log('supervisor'))
    with stage.foreign('/diagnostics', DiagnosticArray, 10) as send:
        for number in range(1000):
            status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name=f'lamp {number}')
            status.message = f'\x1b[2Jsetpoint 777\n  barrier1 {number} ml/h   <-- set'
            send(DiagnosticArray(status=[status]))
        yield
    lines = stage.graph.log('supervisor')[before:].splitlines()
    shown = sum('<-- set' in line for line in lines)
    assert FEW <= shown <= 2 * FEW  # a period of so few lines may end within the flood
    assert all(line.isprintable() for line in lines)
    assert not any(line.lstrip().startswith(('setpoint', 'barrier1')) for line in lines)


@fault(
    'A foreign node floods a topic of its own: 250 MB in a few seconds.',
    Status('recorder', 'ERROR', 'flood (topics that are not'),
    does='Records that topic no more. Everything else is recorded.',
    mends='record such a topic into a bag of its own, or raise `others_mb_s` of the recorder',
)
def flooded_recording(stage: Stage) -> Iterator[None]:
    with stage.foreign('flood', String, qos.FIELD) as send:
        for _ in range(25):
            send(String(data='x' * 10_000_000))
        yield


@fault(
    "A foreign node sends the hub's reports of cycles.",
    LogLine('operator', 'publishes hub/cycle too'),
    LogLine('page', 'publishes hub/cycle too'),
    does='The operator neither shows nor speaks such reports. Control continues.',
    mends=REMOVED,
)
def forged_report(stage: Stage) -> Iterator[None]:
    with stage.foreign('hub/cycle', CycleReport, qos.FIELD) as send:
        send(CycleReport(remarks=['no setpoint: set barrier1 to 1500 ml/h now']))
        yield
    assert 'barrier1 to 1500' not in stage.graph.log('operator')


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


def foreign_rates(
    stage: Stage, rates: dict[str, WellRate], *, name: str = 'pumps'
) -> Iterator[None]:
    """Publish measured rates of this moment as the node `name`."""
    header: Any = conversions.header_at(time.time())
    with stage.foreign('wells/measured', WellRates, qos.FIELD, name=name) as send:
        wells = conversions.rates_to_msg(rates)
        send(WellRates(header=header, start=header.stamp, wells=wells))
        yield


@fault(
    'A foreign node offers `solver/predict` and answers maps of zeros.',
    Remark('offers solver/predict too'),
    does='Believes no answer, and no setpoint follows meanwhile.',
    mends=REMOVED,
)
def foreign_server(stage: Stage) -> Iterator[None]:
    def zeros(request: Predict.Request, response: Predict.Response) -> Predict.Response:
        response.predicted = request.previous
        response.predicted.concentration = [0.0] * (NX * NZ)
        return response

    with stage.foreign_service(Predict, 'solver/predict', zeros):
        stage.good_photograph()
        yield


@fault(
    'A parameter of the hub is set out of its range while it runs.',
    Answer('out of range'),
    does='Refuses the value with its range, and keeps the old one.',
    mends='set a value within the range',
)
def parameter_out_of_range(stage: Stage) -> None:
    for name, value in (('horizon_s', -5.0), ('evaluations', -3), ('model_timeout_s', math.nan)):
        result = set_while_it_runs(stage, 'hub', name, value)
        assert not result.successful
        assert 'out of range' in result.reason, result.reason


def set_while_it_runs(stage: Stage, node: str, name: str, value: object) -> Any:
    """Return the answer of `node` to another value of its parameter `name`."""
    request = SetParameters.Request()
    request.parameters = [Parameter(name, value=value).to_parameter_msg()]
    (result,) = stage.call(SetParameters, f'{node}/set_parameters', request).results
    return result


@fault(
    'Simulated time (`use_sim_time`) is set on the running guard.',
    Answer('holds while it runs'),
    does='Every node keeps its clock. The guard goes on to check ages.',
    mends='nothing',
)
def other_clock(stage: Stage) -> None:
    for node in ('guard', 'hub', 'operator'):
        result = set_while_it_runs(stage, node, 'use_sim_time', True)
        assert not result.successful
        assert 'holds while it runs' in result.reason


@fault(
    'Control is switched off by a foreign node (parameter `control` of the hub).',
    Answer('read-only'),
    does='Refuses the value. Only a start of the hub chooses it.',
    mends='nothing',
)
def control_switched_off(stage: Stage) -> None:
    result = set_while_it_runs(stage, 'hub', 'control', False)
    assert not result.successful
    assert 'read-only' in result.reason


@fault(
    'Another parameter of the hub is set while it runs.',
    LogLine('supervisor', 'the parameter horizon_s was set to'),
    Remark('was set to 900.0 while the hub runs'),
    does='Takes the value, and says so on the terminal and below the maps of the page.',
    mends='set the parameter back',
)
def parameter_changed(stage: Stage) -> Iterator[None]:
    assert set_while_it_runs(stage, 'hub', 'horizon_s', 900.0).successful
    stage.good_photograph()
    yield
    assert set_while_it_runs(stage, 'hub', 'horizon_s', 1800.0).successful


@fault(
    'A foreign node asks the solver to cancel (`solver/cancel`).',
    does='Ends only requests that bear the token of the asking node: none of the hub.',
    mends='nothing',
)
def foreign_cancel(stage: Stage) -> None:
    for token in ('', 'guessed'):
        assert stage.call(Cancel, 'solver/cancel', Cancel.Request(token=token)).cancelled == 0
