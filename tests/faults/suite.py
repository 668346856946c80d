"""The running twins of the fault suite, and what is checked about every fault."""

from contextlib import ExitStack

import pytest

from faults.fault import Answer, Fault
from faults.stage import Stage, running_stage


class Stages:
    """Holds the running twin; after a failure the next fault gets a new one."""

    def __init__(
        self, make_folder: pytest.TempPathFactory, make_domain: object, *, settable: bool
    ) -> None:
        """Begin without a twin; `settable`: tests set the clock of its processes."""
        self._make_folder = make_folder
        self._make_domain = make_domain
        self._settable = settable
        self._open = ExitStack()
        self._stage: Stage | None = None

    def get(self) -> Stage:
        """Return a twin that was not left in disorder."""
        if self._stage is None or not self._stage.healthy:
            self.close()
            folder = self._make_folder.mktemp('stage')
            self._stage = self._open.enter_context(
                running_stage(folder, self._make_domain(), settable=self._settable)
            )
        return self._stage

    def close(self) -> None:
        """End the twin."""
        self._open.close()


def check(fault: Fault, stage: Stage, *, alone: bool = True) -> None:
    """Inject `fault`: it shows, control goes on after it, and no setpoint is wrong.

    After a refusal, and after a fault that is not `alone`, the next fault shows that control goes
    on.
    """
    stage.healthy = False
    since = stage.since()
    with stage.graph.logs_of_a_failure():
        with fault.injected_into(stage):
            for sign in fault.signs:
                stage.wait_for(str(sign), lambda sign=sign: sign.shows(since))
        if alone and not all(isinstance(sign, Answer) for sign in fault.signs):
            stage.wait_for_control()
        stage.check_setpoints()
    stage.healthy = True
