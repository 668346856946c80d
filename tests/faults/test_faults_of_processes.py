"""Killed and stopped processes in a running twin: every fault shows, and control goes on."""

import pytest

from faults.fault import Fault, all_faults
from faults.suite import Stages, check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

FAULTS = [fault for fault in all_faults() if fault.group == 'Processes']


@pytest.mark.parametrize('fault', FAULTS, ids=str)
def test_a_process_that_fails_shows_and_control_goes_on(fault: Fault, stages: Stages) -> None:
    check(fault, stages)
