"""Tests of finding and ending the processes of nodes."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from porotwin_core.basis.parent import PARENT
from porotwin_hub.launching.node_processes import await_end, kill, nodes_of, process_of

LAUNCHER = 'test-of-node-processes'

SLEEPER = "import sys, time; print('here', flush=True); time.sleep(60)"

DEAF = f'import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {SLEEPER}'


def started(name: str, script: str = SLEEPER) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, '-c', script, '--ros-args', '-r', f'__node:={name}'],
        env={**os.environ, PARENT: LAUNCHER},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == 'here\n'
    return process


@pytest.fixture
def sleeper() -> Iterator[subprocess.Popen[str]]:
    process = started('camera')
    yield process
    process.kill()
    process.communicate()


def test_the_nodes_of_a_launcher_are_found_by_name(sleeper: subprocess.Popen[str]) -> None:
    found = nodes_of(LAUNCHER)
    assert set(found) == {'camera'}
    assert found['camera'].pid == sleeper.pid
    assert not found['camera'].stopped
    assert 0.0 <= found['camera'].age_s < 300.0
    assert nodes_of('another launcher') == {}


def test_a_stopped_process_shows(sleeper: subprocess.Popen[str]) -> None:
    sleeper.send_signal(signal.SIGSTOP)
    os.waitpid(sleeper.pid, os.WUNTRACED)
    found = process_of(sleeper.pid)
    assert found is not None
    assert found.stopped


def test_a_process_that_ended_is_none(sleeper: subprocess.Popen[str]) -> None:
    kill(sleeper.pid)
    sleeper.wait()
    assert process_of(sleeper.pid) is None
    assert nodes_of(LAUNCHER) == {}
    kill(sleeper.pid)  # it is no error to kill it twice


def test_a_stopped_process_ends_in_order_and_a_deaf_one_is_killed(
    sleeper: subprocess.Popen[str],
) -> None:
    deaf = started('hub', DEAF)
    sleeper.send_signal(signal.SIGSTOP)
    for process in (sleeper, deaf):
        process.send_signal(signal.SIGTERM)
    await_end([sleeper.pid, deaf.pid], patience_s=1.0)
    assert sleeper.wait(60) == -signal.SIGTERM
    assert deaf.wait(60) == -signal.SIGKILL
    deaf.communicate()
