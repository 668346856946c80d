"""A twin in a DDS domain with many strangers: how it finds itself, and whether control goes on.

    .venv/bin/python -m lab.faults.crowd --participants 120

Each participant is a node of its own DDS participant, as a program of somebody else has it. A part
of them is there before the twin, the others come while it runs.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.context import Context

from lab.faults.endurance import STALL_S, LongRun, long_run
from porotwin_cli.terminal import WorkFailed, say
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.ros.ros_environment import claim_domain, prepare_environment

PER_PROCESS = 20
"""Participants of one process: each has some six threads."""

HOURS = 24.0
"""Simulated time that the virtual rig has [h]: more than the measurement takes."""

CYCLES = 5
"""Cycles with setpoints that are waited for."""


def stand(count: int) -> int:
    """Make `count` participants, say how many could join, and wait for the end of the input."""
    made = []
    for number in range(count):
        context = Context()
        rclpy.init(context=context)
        try:
            made.append(rclpy.create_node(f'stranger_{number}', context=context))
        except RCLError as error:
            print(f'{len(made)} joined: {str(error).splitlines()[0]}', flush=True)
            break
    else:
        print(f'{len(made)} joined', flush=True)
    sys.stdin.read()
    return 0


@contextmanager
def crowd(count: int) -> Iterator[None]:
    """Let `count` participants stand in the domain."""
    processes = []
    begun = time.monotonic()
    try:
        for first in range(0, count, PER_PROCESS):
            number = min(PER_PROCESS, count - first)
            command = [sys.executable, '-m', 'lab.faults.crowd', '--stand', str(number)]
            one = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            processes.append(one)
            assert one.stdout is not None
            say(f'{time.monotonic() - begun:.0f} s: {one.stdout.readline().strip()}')
        yield
    finally:
        for one in processes:
            one.kill()
            one.wait()


def control(run: LongRun, who: str) -> None:
    """Wait for some cycles with setpoints, and say how long they took."""
    begun = time.monotonic()
    until = run.time + CYCLES * USUAL_PHOTO_INTERVAL_S
    if not run.wait_until(until, limit=STALL_S, control=True):
        raise WorkFailed(f'{who}: no setpoint within {STALL_S:g} s: {run.last_remark}')
    say(f'{who}: {CYCLES} cycles in {time.monotonic() - begun:.1f} s')


def measure(participants: int) -> None:
    """Say how a twin does among so many participants; half of them come while it runs."""
    prepare_environment()
    with claim_domain():
        pass  # sets ROS_DOMAIN_ID for all of them
    before = participants // 2
    with crowd(before):
        begun = time.monotonic()
        with long_run(HOURS, seed=1) as run:
            say(f'first cycle {time.monotonic() - begun:.0f} s after the start, beside {before}')
            control(run, f'beside {before}')
            with crowd(participants - before):
                control(run, f'beside {participants}')
            control(run, 'after half have gone')


def main() -> int:
    """Measure, or be a part of the crowd."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--participants', type=int, default=120)
    parser.add_argument('--stand', type=int, default=0, help=argparse.SUPPRESS)
    settings = parser.parse_args()
    if settings.stand:
        return stand(settings.stand)
    try:
        measure(settings.participants)
    except WorkFailed as error:
        say(str(error))
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
