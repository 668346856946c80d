"""Bad photographs, foreign messages and people in a running twin.

Every fault shows, and control goes on. One twin meets all of them, because its start costs as much
as the faults.
"""

import pytest

from faults.fault import Fault, all_faults
from faults.suite import Stages, check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

FAULTS = [
    fault for fault in all_faults() if fault.group not in ('Clocks', 'Processes', 'Shared memory')
]


@pytest.mark.parametrize('fault', FAULTS, ids=str)
def test_a_fault_shows_and_control_goes_on(fault: Fault, stages: Stages) -> None:
    check(fault, stages.get())
