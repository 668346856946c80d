"""A full shared memory under a running twin, in a small one that only its processes see."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from faults.fault import all_faults
from faults.stage import running_stage
from faults.suite import check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

NAMESPACE = ('unshare', '--user', '--map-root-user', '--mount', 'sh', '-c')
MOUNT = 'mount -t tmpfs -o size=64m tmpfs /dev/shm'


def test_a_full_memory_shows_and_control_goes_on(tmp_path: Path, domain: int) -> None:
    if subprocess.run([*NAMESPACE, MOUNT], check=False, capture_output=True).returncode:
        pytest.skip('this machine lets no user mount a small memory')
    command = (sys.executable, __file__, str(tmp_path), str(domain))
    done = subprocess.run(
        [*NAMESPACE, f'{MOUNT} && exec "$@"', 'sh', *command],
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-1000:]
    assert 'full_shared_memory' in done.stdout


if __name__ == '__main__':
    with running_stage(Path(sys.argv[1]), int(sys.argv[2])) as stage:
        for fault in all_faults():
            if fault.group == 'Shared memory':
                check(fault, stage)
                print(fault)
