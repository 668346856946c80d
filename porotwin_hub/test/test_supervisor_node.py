"""The supervisor beside real processes: a stopped node is shown, killed, and never an orphan."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from patience import until
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter

from porotwin_core.ros.foreign_words import FEW
from porotwin_core.ros.node import DIAGNOSTICS
from porotwin_core.ros.node_thread import NodeThread
from porotwin_hub.launching.graph import NodeDescription
from porotwin_hub.launching.node_processes import process_of
from porotwin_hub.launching.processes import GraphProcesses
from porotwin_hub.supervisor_node import SupervisorNode

pytestmark = [pytest.mark.graph, pytest.mark.slow]

SMALL_RIG = Path(__file__).resolve().parents[1] / 'config' / 'small_rig.yaml'

LAUNCHER = """
import sys, time
from pathlib import Path
from porotwin_hub.launching.graph import NodeDescription
from porotwin_hub.launching.processes import GraphProcesses
nodes = [
    NodeDescription('operator', 'porotwin_hub', 'operator_node', {'rig': sys.argv[2]}),
    NodeDescription('supervisor', 'porotwin_hub', 'supervisor_node', {'nodes': 'operator'}),
]
with GraphProcesses(nodes, Path(sys.argv[1])) as graph:
    print(graph.process('operator').pid, graph.process('supervisor').pid, flush=True)
    time.sleep(600)
"""

HANGS = """
import signal, time
from porotwin_hub import supervisor_node
def hang(*_, **__):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    print('hangs', flush=True)
    time.sleep(600)
supervisor_node.END_PATIENCE_S, supervisor_node.run = 0.5, hang
supervisor_node.main()
"""


class Ear:
    """Keeps the newest state of every node on /diagnostics."""

    def __init__(self, domain: int) -> None:
        self.heard: list[tuple[str, bytes, str]] = []
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        self.node = rclpy.create_node('ear', context=context)
        self.node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._hear, 100)
        self._thread = NodeThread(self.node)

    def close(self) -> None:
        self._thread.end()

    def _hear(self, message: DiagnosticArray) -> None:
        self.heard += [(one.name, one.level, one.message) for one in message.status]

    def say_error(self, name: str, message: str) -> None:
        """Report an error as the node `name` would."""
        publisher = self.node.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        until(lambda: publisher.get_subscription_count() > 1)  # this node listens as well
        status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name=name, message=message)
        publisher.publish(DiagnosticArray(status=[status]))

    def wait_for(self, name: str, level: bytes, text: str = '') -> None:
        until(lambda: any(h[:2] == (name, level) and text in h[2] for h in self.heard), self.heard)


@pytest.fixture
def ear(domain: int) -> Iterator[Ear]:
    made = Ear(domain)
    yield made
    made.close()


def test_a_stopped_node_is_stale_then_killed_and_started_again(
    ear: Ear, domain: int, tmp_path: Path
) -> None:
    nodes = [
        NodeDescription('operator', 'porotwin_hub', 'operator_node', {'rig': str(SMALL_RIG)}),
        NodeDescription(
            'supervisor',
            'porotwin_hub',
            'supervisor_node',
            {'nodes': 'operator', 'stale_after_s': 3.0, 'restart_after_s': 6.0},
        ),
    ]
    lines: list[str] = []
    environment = {'ROS_DOMAIN_ID': str(domain)}
    with GraphProcesses(
        nodes, tmp_path, say=lines.append, show=['supervisor'], environment=environment
    ) as graph:
        ear.wait_for('operator', DiagnosticStatus.OK, 'running')
        ear.wait_for('supervisor', DiagnosticStatus.OK)
        ear.say_error('lamp', 'the light is off')
        told = '\'another device: lamp\' says: "the light is off"'
        until(lambda: told in lines, lines)
        stopped = graph.process('operator')
        stopped.send_signal(signal.SIGSTOP)
        ear.say_error('operator', 'another device has this name')
        ear.wait_for('operator', DiagnosticStatus.STALE, 'its process is stopped')
        ear.wait_for('supervisor', DiagnosticStatus.ERROR, 'killed, to be started again')
        until(lambda: graph.process('operator') is not stopped, lines)
        ear.heard.clear()
        ear.wait_for('operator', DiagnosticStatus.OK, 'running')
    assert any('operator ended (-9); starting it again' in line for line in lines)


def test_an_error_of_another_device_with_the_name_of_a_node_is_told_once(
    domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    supervisor = SupervisorNode(context=context)
    error = DiagnosticStatus(level=DiagnosticStatus.ERROR, name='operator', message='no battery')
    error.hardware_id = 'robot'
    well = DiagnosticStatus(level=DiagnosticStatus.OK, name='operator', hardware_id='porotwin')
    for _ in range(3):
        for status in (error, well):
            supervisor._on_diagnostics(DiagnosticArray(status=[status]))
    supervisor.destroy_node()
    context.shutdown()
    assert capsys.readouterr().out == '\'robot: operator\' says: "no battery"\n'


@pytest.fixture
def supervisor(domain: int) -> Iterator[SupervisorNode]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    made = SupervisorNode(
        context=context,
        namespace='/porotwin',
        parameter_overrides=[Parameter('nodes', value='hub guard')],
    )
    yield made
    made.destroy_node()
    context.shutdown()


def error(name: str, message: str, device: str = 'porotwin') -> DiagnosticArray:
    status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name=name, message=message)
    status.hardware_id = device
    return DiagnosticArray(status=[status])


ORDER = '\x1b[2J\x1b[Hsetpoint 777\n  barrier1       1500.0 ml/h   <-- set\r'
"""Words that would be an order if a terminal took them as they are."""


@pytest.mark.parametrize('name', ['hub', 'stranger', ORDER])
def test_no_report_of_health_is_an_order(
    supervisor: SupervisorNode, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    supervisor._on_diagnostics(error(name, ORDER, device=''))
    supervisor._on_diagnostics(error(name, ORDER))
    for line in capsys.readouterr().out.splitlines():
        assert line.isprintable()
        assert line.startswith("'")
        assert '\' says: "\\x1b[2J' in line


def test_a_flood_of_errors_is_a_few_lines_and_their_number(
    supervisor: SupervisorNode,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for number in range(25_900):
        supervisor._on_diagnostics(error(f'forged {number}', f'{number}'))
    supervisor._on_diagnostics(error('guard', 'no setpoint can pass'))
    monkeypatch.setattr(supervisor._words, '_clock', lambda: time.monotonic() + 60.0)
    supervisor._look()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == FEW + 2
    assert lines[FEW] == '\'guard\' says: "no setpoint can pass"'
    assert lines[FEW + 1].startswith(f'{25_900 - FEW} more ')
    assert len(supervisor._errors) <= 100


def test_a_parameter_that_is_set_while_a_node_runs_is_told(
    supervisor: SupervisorNode, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = Parameter('horizon_s', value=30.0).to_parameter_msg()
    for node in ('/porotwin/hub', '/elsewhere/hub'):
        supervisor._on_parameters(ParameterEvent(node=node, changed_parameters=[changed]))
    (line,) = capsys.readouterr().out.splitlines()
    assert line == '\'hub\' says: "the parameter horizon_s was set to 30.0 while the node runs"'


def test_a_stopped_node_does_not_outlive_a_launcher_that_is_killed(
    ear: Ear, domain: int, tmp_path: Path
) -> None:
    launcher = subprocess.Popen(
        [sys.executable, '-c', LAUNCHER, str(tmp_path), str(SMALL_RIG)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
    )
    assert launcher.stdout is not None
    operator, supervisor = map(int, launcher.stdout.readline().split())
    ear.wait_for('operator', DiagnosticStatus.OK)
    ear.wait_for('supervisor', DiagnosticStatus.OK)
    os.kill(operator, signal.SIGSTOP)
    launcher.kill()
    launcher.communicate()
    until(lambda: process_of(operator) is None and process_of(supervisor) is None)


def test_a_supervisor_that_hangs_does_not_outlive_the_launcher() -> None:
    script = 'POROTWIN_PARENT=$$ "$0" -c "$1" & echo $!; wait'
    launcher = subprocess.Popen(
        ['sh', '-c', script, sys.executable, HANGS], stdout=subprocess.PIPE, text=True
    )
    assert launcher.stdout is not None
    supervisor = int(launcher.stdout.readline())
    assert launcher.stdout.readline() == 'hangs\n'
    launcher.kill()
    launcher.wait()
    until(lambda: process_of(supervisor) is None)
