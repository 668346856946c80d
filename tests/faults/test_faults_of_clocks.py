"""The clock of this machine is set under a running twin: it shows, and control goes on."""

import pytest

from faults.fault import Fault, all_faults
from faults.suite import Stages, check

pytestmark = pytest.mark.graph  # beside the tests of nodes: it waits most of the time

SETTABLE_CLOCK = True

FAULTS = [fault for fault in all_faults() if fault.group == 'Clocks']


@pytest.mark.parametrize('fault', FAULTS, ids=str)
def test_a_clock_that_is_set_shows_and_control_goes_on(fault: Fault, stages: Stages) -> None:
    check(fault, stages)
