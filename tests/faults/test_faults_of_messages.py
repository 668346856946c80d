"""Foreign messages and people in a running twin: every fault shows, and control goes on.

All faults that have no file of their own are here as well.
"""

import pytest

from faults.fault import Fault, all_faults
from faults.suite import Stages, check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

ELSEWHERE = ('Photographs', 'Processes')
"""Groups of faults with a file of their own."""

FAULTS = [fault for fault in all_faults() if fault.group not in ELSEWHERE]


@pytest.mark.parametrize('fault', FAULTS, ids=str)
def test_any_other_fault_shows_and_control_goes_on(fault: Fault, stages: Stages) -> None:
    check(fault, stages)
