"""A full shared memory under a running twin, in a small one that only its processes see."""

import os
import subprocess
import sys

import pytest

from faults.fault import Fault, all_faults
from faults.suite import Stages, check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

INSIDE = 'POROTWIN_TEST_SMALL_MEMORY'
NAMESPACE = ('unshare', '--user', '--map-root-user', '--mount', 'sh', '-c')
MOUNT = 'mount -t tmpfs -o size=64m tmpfs /dev/shm'

FAULTS = [fault for fault in all_faults() if fault.group == 'Shared memory']


@pytest.mark.parametrize('fault', FAULTS, ids=str)
def test_a_full_memory_shows_and_control_goes_on(fault: Fault, stages: Stages) -> None:
    if INSIDE not in os.environ:
        pytest.skip('runs in the small memory of the next test')
    check(fault, stages)


def test_in_a_small_memory() -> None:
    if INSIDE in os.environ:
        pytest.skip('is what runs')
    if subprocess.run([*NAMESPACE, MOUNT], check=False, capture_output=True).returncode:
        pytest.skip('this machine lets no user mount a small memory')
    command = (sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', __file__)
    done = subprocess.run(
        [*NAMESPACE, f'{MOUNT} && exec "$@"', 'sh', *command],
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, INSIDE: 'yes'},
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-1000:]
    assert '1 passed' in done.stdout, done.stdout[-5000:]
