"""Shared memory. The memory that the nodes of a machine share is full."""

from collections.abc import Iterator
from pathlib import Path

from faults.fault import Status, SupervisorLine, fault
from faults.stage import Stage, kill

FOLDER = Path('/dev/shm')
PART_BYTES = 1 << 16


@fault(
    'The shared memory (`/dev/shm`) is full while the twin runs, and a node ends.',
    Status('supervisor', 'WARN', 'no node can start again: /dev/shm: has'),
    SupervisorLine('costa ended (-9); starting it again'),
    does='Running nodes go on, for they have their share. Control continues. A node that starts '
    'again waits until there is space.',
    mends='remove old files in `/dev/shm`, or give it more space',
)
def full_shared_memory(stage: Stage) -> Iterator[None]:
    filler = FOLDER / 'filler'
    try:
        with filler.open('wb', buffering=0) as file:
            while file.write(bytes(PART_BYTES)) == PART_BYTES:
                pass
    except OSError:
        pass  # it is full
    stage.wait_for_control()
    kill(stage, 'costa')
    stage.wait_for_control()
    yield
    filler.unlink()
    began = stage.graph.log('costa').count('no model loaded')
    stage.wait_for('COSTA', lambda: stage.graph.log('costa').count('no model loaded') > began)
