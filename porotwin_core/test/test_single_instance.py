"""Tests of the claim to a node's name: one process per domain, and no lock-out by a ghost."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from patience import PATIENCE_S

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

pytestmark = pytest.mark.graph

SCRIPT = """
from rclpy.node import Node
from porotwin_core.ros import single_instance
from porotwin_core.ros.node import run
from porotwin_core.ros.single_instance import another_lives, only_one
single_instance.END_S = 0.5  # nobody is being stopped

class Thing(Node):
    def __init__(self):
        super().__init__('thing')
        self.create_timer(1.0, lambda: print('made', another_lives(self), flush=True))

run(only_one(Thing, 'thing'))
"""


@contextmanager
def thing(*arguments: str, domain: int) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, '-c', SCRIPT, '--ros-args', *arguments],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE_S)


def first_line(process: subprocess.Popen[str]) -> str:
    """Return the first line; Fast DDS tells before it that two processes open a port at once."""
    assert process.stdout is not None
    while 'RTPS_' in (line := process.stdout.readline()):
        pass
    return line.strip()


def test_a_second_node_of_a_name_is_refused_unless_it_is_elsewhere(domain: int) -> None:
    with thing(domain=domain) as first:
        assert first_line(first) == 'made'
        with thing(domain=domain) as second, thing('-r', '__ns:=/other', domain=domain) as other:
            output, errors = second.communicate(timeout=PATIENCE_S)
            assert (second.returncode, output) == (2, '')
            assert errors.startswith('error: another node /thing runs in this ROS domain; stop it')
            assert len(errors.splitlines()) == 1
            assert first_line(other) == 'made'


def test_a_restarted_node_is_not_locked_out_by_its_ghost(domain: int) -> None:
    with thing(domain=domain) as first:
        assert first_line(first) == 'made'
        first.send_signal(signal.SIGKILL)
        first.wait(PATIENCE_S)
    with thing(domain=domain) as second:
        assert first_line(second) == 'made'
