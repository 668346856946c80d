"""Processes. Nodes that die, hang or do not answer."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from faults.fault import Answer, Remark, Status, SupervisorLine, fault
from faults.stage import ENVIRONMENT, Stage, kill
from porotwin_hub.launching.graph import NAMESPACE

RESTARTED = 'Starts the node again.'
BY_ITSELF = 'nothing'
HUNG = 'Shows the node as stale after 5 s. Kills and restarts it after `restart_after_s`.'


@contextmanager
def stopped(stage: Stage, node: str) -> Iterator[None]:
    """Stop the process of a node, and let it go on at the end."""
    process = stage.pid(node)
    stage.signal(node, signal.SIGSTOP)
    yield
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGCONT)


@fault(
    'The imaging is killed.',
    SupervisorLine('imaging ended (-9); starting it again'),
    does=RESTARTED + ' The baseline is published for it again.',
    mends=BY_ITSELF,
)
def imaging_killed(stage: Stage) -> None:
    kill(stage, 'imaging')


@fault(
    'The solver is killed.',
    SupervisorLine('solver ended (-9); starting it again'),
    does=RESTARTED + ' Until then the last setpoint holds while it is valid.',
    mends=BY_ITSELF,
)
def solver_killed(stage: Stage) -> Iterator[None]:
    kill(stage, 'solver')
    yield
    stage.wait_for_forecast()


@fault(
    'COSTA is killed.',
    SupervisorLine('costa ended (-9); starting it again'),
    does=RESTARTED + ' Until then forecasts are not corrected.',
    mends=BY_ITSELF,
)
def costa_killed(stage: Stage) -> None:
    kill(stage, 'costa')


@fault(
    'The hub is killed.',
    SupervisorLine('hub ended (-9); starting it again'),
    does=RESTARTED + ' The setpoint in force expires by itself.',
    mends=BY_ITSELF,
)
def hub_killed(stage: Stage) -> None:
    kill(stage, 'hub')


@fault(
    'The guard is killed.',
    SupervisorLine('guard ended (-9); starting it again'),
    does=RESTARTED + ' Until then no setpoint reaches the pumps.',
    mends=BY_ITSELF,
)
def guard_killed(stage: Stage) -> None:
    kill(stage, 'guard')


@fault(
    'The supervisor is killed.',
    SupervisorLine('supervisor ended (-9); starting it again'),
    does=RESTARTED,
    mends=BY_ITSELF,
)
def supervisor_killed(stage: Stage) -> None:
    kill(stage, 'supervisor')


@fault(
    'The operator bridge is killed.',
    SupervisorLine('operator ended (-9); starting it again'),
    does=RESTARTED,
    mends=BY_ITSELF,
)
def operator_killed(stage: Stage) -> None:
    kill(stage, 'operator')


@fault(
    'The camera node is killed.',
    SupervisorLine('camera ended (-9); starting it again'),
    does=RESTARTED,
    mends=BY_ITSELF,
)
def camera_killed(stage: Stage) -> Iterator[None]:
    before = len(stage.graph.log('camera'))
    kill(stage, 'camera')
    yield
    stage.wait_for_control()
    assert 'duplicate' not in stage.graph.log('camera')[before:]  # those were sent before it ended


@fault(
    'The recorder is killed.',
    SupervisorLine('recorder ended (-9); starting it again'),
    does=RESTARTED + ' It goes on in a new bag beside the first one.',
    mends=BY_ITSELF,
)
def recorder_killed(stage: Stage) -> None:
    kill(stage, 'recorder')


@fault(
    'The page is killed.',
    SupervisorLine('page ended (-9); starting it again'),
    does=RESTARTED + ' Control goes on without it.',
    mends=BY_ITSELF,
)
def page_killed(stage: Stage) -> None:
    kill(stage, 'page')


@fault(
    'A second twin starts in the same domain.',
    Answer('another node /porotwin/hub runs in this ROS domain'),
    does='The second one refuses to start, with one line. Control continues.',
    mends='give each rig a domain of its own (`--domain`)',
)
def second_twin(stage: Stage) -> None:
    command = [
        sys.executable,
        '-m',
        'porotwin_hub.hub_node',
        '--ros-args',
        '-r',
        f'__ns:={NAMESPACE}',
    ]
    second = subprocess.run(
        [*command, '-p', f'rig:={stage.folder / "rig.yaml"}'],
        env={**ENVIRONMENT, 'ROS_DOMAIN_ID': str(stage.domain)},
        capture_output=True,
        check=False,
        text=True,
        timeout=60.0,
    )
    assert second.returncode == 2, second.stderr
    last = second.stderr.strip().splitlines()[-1]
    assert 'another node /porotwin/hub runs in this ROS domain' in last
    assert 'ROS_DOMAIN_ID' in last


@fault(
    'Somebody ends the page (SIGTERM).',
    SupervisorLine('page ended (somebody ended it); starting it again'),
    does=RESTARTED + ' So is every node that ends before the twin is stopped.',
    mends=BY_ITSELF,
)
def page_ended(stage: Stage) -> None:
    kill(stage, 'page', signal.SIGTERM)


@fault(
    'The solver hangs (SIGSTOP).',
    Remark("service 'solver/"),
    does='Waits for the model no longer than `model_timeout_s`. The last setpoint holds while it '
    'is valid; afterwards the safe rates.',
    mends='nothing: control continues when the solver answers again',
)
def solver_silent(stage: Stage) -> Iterator[None]:
    with stopped(stage, 'solver'):
        stage.good_photograph()
        yield


@fault(
    'COSTA hangs (SIGSTOP).',
    Remark('costa'),
    does='Does not correct the forecast. Control continues.',
    mends='nothing: corrections continue when COSTA answers again',
)
def costa_silent(stage: Stage) -> Iterator[None]:
    with stopped(stage, 'costa'):
        stage.good_photograph()
        yield


@fault(
    'The operator bridge hangs (SIGSTOP): nobody takes the setpoint.',
    Remark('not taken'),
    does='Reports this. The setpoint does not count as pumped.',
    mends='nothing: the pumps are set when the operator bridge answers again',
)
def operator_silent(stage: Stage) -> Iterator[None]:
    with stopped(stage, 'operator'):
        stage.good_photograph()
        yield


@fault(
    'The camera node hangs (SIGSTOP).',
    Status('camera', 'STALE', 'silent for'),
    does=HUNG,
    mends=BY_ITSELF,
)
def camera_stopped(stage: Stage) -> Iterator[None]:
    with stopped(stage, 'camera'):
        yield


@fault(
    'The imaging hangs (SIGSTOP).',
    Status('imaging', 'STALE', 'silent for'),
    does=HUNG,
    mends=BY_ITSELF,
)
def imaging_stopped(stage: Stage) -> Iterator[None]:
    with stopped(stage, 'imaging'):
        yield


@fault(
    'The guard hangs (SIGSTOP).',
    Status('guard', 'STALE', 'silent for'),
    does=HUNG,
    mends=BY_ITSELF,
)
def guard_stopped(stage: Stage) -> Iterator[None]:
    with stopped(stage, 'guard'):
        yield


@fault(
    'The hub hangs (SIGSTOP) and does not go on by itself.',
    Status('hub', 'STALE', 'silent for'),
    SupervisorLine('hub ended (-9); starting it again'),
    does=HUNG,
    mends=BY_ITSELF,
)
def hub_hangs(stage: Stage) -> None:
    stage.signal('hub', signal.SIGSTOP)
