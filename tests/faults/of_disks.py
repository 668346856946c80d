"""Disks. Disks that are full."""

import resource
from collections.abc import Iterator

from faults.fault import Status, fault
from faults.stage import Stage

FULL_AT_BYTES = 1000
"""Size beyond which the recorder cannot write [bytes]; its file is larger already."""


@fault(
    'The disk of the recorder is full.',
    Status('recorder', 'ERROR', 'the disk refuses data'),
    does='Reports the recorded and the lost amount. Control continues.',
    mends='free space on the disk: the recorder then continues',
)
def full_disk(stage: Stage) -> Iterator[None]:
    recorder = stage.pid('recorder')
    before = resource.prlimit(recorder, resource.RLIMIT_FSIZE)
    resource.prlimit(recorder, resource.RLIMIT_FSIZE, (FULL_AT_BYTES, before[1]))
    stage.good_photograph()
    yield
    resource.prlimit(recorder, resource.RLIMIT_FSIZE, before)
