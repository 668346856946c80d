"""The diagnosis as an action over DDS: refusals, feedback, and cancelling."""

import threading
import time
from functools import partial

import numpy as np
import pytest
from diagnosis_examples import SMALL
from patience import PATIENCE_S, until

from porotwin_core.basis.units import DAY_S
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import write_rig

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rclpy.action import ActionClient  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from porotwin_core.ros import (  # noqa: E402
    conversions,
    qos,
)
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_core.ros.senders import TERMINAL, goals_of  # noqa: E402
from porotwin_core.ros.vouching import Voucher  # noqa: E402
from porotwin_diagnosis.diagnosis_node import DiagnosisNode  # noqa: E402
from porotwin_msgs.action import Diagnose  # noqa: E402
from porotwin_msgs.msg import NewState, Outcome, Setpoint  # noqa: E402
from porotwin_recording.experiment.recording import open_recording  # noqa: E402

pytestmark = pytest.mark.graph


class Graph:
    """The node and a client of it, each with an executor of its own."""

    def __init__(self, rig, *, simulated=True, domain=None):  # stamps of any time are believed
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        grid = SMALL.grid(47, 28)
        given = {'rig': str(rig), 'grid': str(grid), 'use_sim_time': simulated}
        parameters = [Parameter(name, value=value) for name, value in given.items()]
        self.grid = grid
        self.server = DiagnosisNode(context=context, parameter_overrides=parameters)
        self.node = rclpy.create_node('player' if simulated else 'imaging', context=context)
        person = rclpy.create_node(TERMINAL, context=context)
        self._thread = NodeThread(self.server, self.node, person, threads=4)
        self.voucher = Voucher(person)
        self.client = ActionClient(person, Diagnose, 'diagnosis/diagnose')
        assert self.client.wait_for_server(PATIENCE_S)

    def wait(self, future):
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(PATIENCE_S), f'no answer in {PATIENCE_S} s'
        return future.result()

    def goal(self, *, vouched=True, **fields):
        feedback = []
        goal = Diagnose.Goal(**fields)
        if vouched:
            self.voucher.vouch(goals_of('diagnosis/diagnose'), goal)
        handle = self.wait(
            self.client.send_goal_async(goal, lambda message: feedback.append(message.feedback))
        )
        return handle, feedback

    def refusal(self, **fields):
        """Return the outcome of a goal, which must be refused."""
        handle, _ = self.goal(**fields)
        outcome = self.wait(handle.get_result_async()).result.outcome
        assert outcome.code != Outcome.OK
        return outcome.message

    def close(self):
        self.client.destroy()  # a node that ends leaves it
        self._thread.end()


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    rig = tmp_path_factory.mktemp('rig') / 'rig.yaml'
    write_rig(SMALL, rig)
    graph = Graph(rig)
    yield graph
    graph.close()


def test_a_graph_that_has_shown_nothing_is_refused_with_a_reason(graph):
    assert 'no map has arrived' in graph.refusal()


def test_who_does_not_vouch_gets_no_diagnosis(graph, tmp_path):
    handle, _ = graph.goal(vouched=False, output=str(tmp_path))
    assert not handle.accepted


def test_an_older_report_stays(graph, tmp_path, quiet):
    for name in ('diagnosis.json', 'report.html'):
        (tmp_path / name).write_text('{}')
    for recording in ('', str(quiet)):
        line = graph.refusal(recording=recording, output=str(tmp_path))
        assert line.startswith(f'{tmp_path}: is not empty')
        assert line.endswith('name a new folder for the report')
    assert sorted(one.name for one in tmp_path.iterdir()) == ['diagnosis.json', 'report.html']
    assert (tmp_path / 'report.html').read_text() == '{}'


def test_the_run_so_far_is_judged_and_too_few_states_are_refused(graph):
    publisher = graph.node.create_publisher(NewState, 'asset/new_state', qos.FIELD)
    setpoints = graph.node.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
    for topic in ('asset/new_state', 'wells/setpoint'):
        until(partial(graph.server.count_publishers, topic))
    setpoints.publish(Setpoint(wells=conversions.rates_to_msg({'injector': WellRate()})))
    for number in range(3):
        tracer = conversions.tracer_to_msg(np.zeros(graph.grid.shape), graph.grid, 30.0 * number)
        message = NewState(sequence=number, tracer=tracer)
        message.header.stamp = tracer.header.stamp
        publisher.publish(message)
    # messages arrive one after the other, and the setpoint may be the last
    until(lambda: 'the run so far: 3 maps are too few' in graph.refusal())


def test_the_run_so_far_tells_how_its_maps_were_made(graph, tmp_path):
    publisher = graph.node.create_publisher(NewState, 'asset/new_state', qos.FIELD)
    setpoints = graph.node.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
    for topic in ('asset/new_state', 'wells/setpoint'):
        until(partial(graph.server.count_publishers, topic))
    setpoints.publish(Setpoint(wells=conversions.rates_to_msg({'injector': WellRate()})))
    tracer = conversions.tracer_to_msg(np.zeros(graph.grid.shape), graph.grid, 900.0)
    state = NewState(tracer=tracer, header=tracer.header, calibrated=True, calibration='ab' * 32)
    publisher.publish(state)
    run = graph.server._run
    until(lambda: run.rates.commanded(900.0) and 900.0 in run.times)
    run.write(tmp_path / 'run')
    origin = open_recording(tmp_path / 'run').maps.origin
    assert (origin.calibrated, origin.calibration) == (True, 'ab' * 32)


def test_a_photograph_with_a_wrong_stamp_does_not_end_the_run(tmp_path, domain):
    write_rig(SMALL, tmp_path / 'rig.yaml')
    # in a domain without the player of the other tests, from which it takes nothing
    graph = Graph(tmp_path / 'rig.yaml', simulated=False, domain=domain)
    try:
        publisher = graph.node.create_publisher(NewState, 'asset/new_state', qos.FIELD)
        until(partial(graph.server.count_publishers, 'asset/new_state'))
        until(publisher.get_subscription_count)
        now = time.time()
        for stamp in (now - 60.0, now - 30.0, now + DAY_S, now):
            tracer = conversions.tracer_to_msg(np.zeros(graph.grid.shape), graph.grid, stamp)
            publisher.publish(NewState(tracer=tracer, header=tracer.header))
        until(lambda: len(graph.server._run) == 3)
        assert graph.server._run.times == pytest.approx((now - 60.0, now - 30.0, now), abs=1e-3)
    finally:
        graph.close()


def test_a_folder_with_a_run_in_it_is_refused_and_not_changed(graph, tmp_path):
    precious = tmp_path / 'run' / 'photos' / 'first.jpg'
    precious.parent.mkdir(parents=True)
    precious.write_bytes(b'')
    handle, _ = graph.goal(output=str(tmp_path))
    outcome = graph.wait(handle.get_result_async()).result.outcome
    assert 'run: exists already; name another folder' in outcome.message
    assert precious.exists()
    handle, _ = graph.goal(output=str(tmp_path / 'new'))
    outcome = graph.wait(handle.get_result_async()).result.outcome
    assert outcome.code != Outcome.OK
    assert not (tmp_path / 'new' / 'run').exists(), 'the refused run is removed'


def test_a_running_diagnosis_reports_progress_refuses_another_and_can_be_canceled(
    graph, quiet, tmp_path
):
    handle, feedback = graph.goal(recording=str(quiet), output=str(tmp_path / 'out'))
    until(lambda: len(feedback) > 1)
    assert 0.0 <= feedback[-1].fraction < 1.0
    second, _ = graph.goal(recording=str(quiet), output=str(tmp_path / 'second'))
    refused = graph.wait(second.get_result_async()).result.outcome
    assert refused.code != Outcome.OK
    assert refused.message == 'diagnosis: one is running; wait for its result or cancel it'
    assert not graph.wait(handle.cancel_goal_async()).goals_canceling  # nobody vouches for it
    assert graph.wait(graph.voucher.cancel('diagnosis/diagnose', handle)).goals_canceling
    outcome = graph.wait(handle.get_result_async()).result.outcome
    assert outcome.message == 'diagnosis canceled'
    assert not (tmp_path / 'out' / 'diagnosis.json').exists()
