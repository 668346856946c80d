"""Killed and stopped processes, and a clock that is set, under a running twin.

Every fault shows, and control goes on. One twin meets all of them, because its start costs as much
as many faults.
"""

import pytest

from faults.fault import Fault, all_faults
from faults.suite import Stages, check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

SETTABLE_CLOCK = True

FAULTS = [fault for fault in all_faults() if fault.group in ('Clocks', 'Processes')]
LAST_KILLED = [fault for fault in FAULTS if fault.name.endswith('_killed')][-1]
"""The nodes are killed one after the other: the graph forgets a dead hub and a dead guard at
once, and control goes on when all are there again."""


@pytest.mark.parametrize('fault', FAULTS, ids=str)
def test_a_failure_or_a_set_clock_shows_and_control_goes_on(fault: Fault, stages: Stages) -> None:
    killed_before_others = fault.name.endswith('_killed') and fault is not LAST_KILLED
    check(fault, stages.get(), alone=not killed_before_others)
