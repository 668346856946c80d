"""Tests of the decision who is silent, who hangs, and who only computes."""

import dataclasses

import pytest

from porotwin_hub.launching.liveness import COMPUTING_FACTOR, Liveness
from porotwin_hub.launching.node_processes import NodeProcess


class Watch:
    """A liveness with a clock and processes that a test sets; one second passes with each look."""

    def __init__(self) -> None:
        self.time = 100.0
        self.hears_itself = True
        self.processes = {'hub': NodeProcess(7, stopped=False, age_s=1000.0, cpu_s=50.0)}
        self.liveness = Liveness(['hub'], own='supervisor', clock=lambda: self.time)

    def change(self, **values: object) -> None:
        self.processes['hub'] = dataclasses.replace(self.processes['hub'], **values)

    def after(self, seconds: int, cpu_share: float = 0.0) -> list[tuple[str, bool]]:
        """Return messages and whether the nodes hang after some silent seconds."""
        found = []
        for _ in range(seconds):
            self.time += 1.0
            hub = self.processes.get('hub')
            if hub is not None:
                self.change(cpu_s=hub.cpu_s + cpu_share, age_s=hub.age_s + 1.0)
            if self.hears_itself:
                self.liveness.heard('supervisor')
            found = self.liveness.silent(lambda: self.processes)
        return [(one.message, one.hangs) for one in found]


@pytest.fixture
def watch() -> Watch:
    return Watch()


def test_a_node_that_reports_is_not_silent(watch: Watch) -> None:
    for _ in range(100):
        watch.liveness.heard('hub')
        assert watch.after(4) == []


def test_a_silent_node_is_stale_at_once_and_hangs_later(watch: Watch) -> None:
    assert watch.after(4) == []
    assert watch.after(3) == [('silent for 7 s: it hangs', False)]
    assert watch.after(24) == [('silent for 31 s: it hangs', True)]


def test_a_stopped_process_is_named(watch: Watch) -> None:
    watch.change(stopped=True)
    assert watch.after(6) == [('silent for 6 s: its process is stopped', False)]
    assert watch.after(25)[0][1]


def test_nobody_is_silent_for_a_watcher_that_does_not_hear_itself(watch: Watch) -> None:
    assert watch.after(4) == []
    watch.hears_itself = False
    assert watch.after(100) == []
    assert watch.liveness.deaf
    watch.hears_itself = True
    assert watch.after(5) == []
    assert not watch.liveness.deaf
    assert watch.after(26)[0][1]


def test_a_process_that_computes_has_more_time(watch: Watch) -> None:
    assert watch.after(60, cpu_share=1.0) == [('silent for 60 s: it computes', False)]
    assert watch.after(int(30 * COMPUTING_FACTOR), cpu_share=1.0)[0][1]


def test_a_node_that_starts_has_the_patience_of_a_start(watch: Watch) -> None:
    watch.change(age_s=0.0)
    assert watch.after(60) == [('silent for 60 s: it is starting', False)]
    assert watch.after(250)[0][1]


def test_a_node_that_was_started_again_has_it_too(watch: Watch) -> None:
    watch.after(50)
    watch.change(age_s=0.0, cpu_s=0.0)
    assert watch.after(40, cpu_share=1.0) == [('silent for 40 s: it is starting', False)]


def test_a_node_without_a_process_is_left_to_its_launcher(watch: Watch) -> None:
    watch.processes.clear()
    message, hangs = watch.after(400)[0]
    assert message == 'silent for 400 s: no process of it is known here'
    assert not hangs


def test_after_a_pause_of_its_own_nobody_counts_as_silent(watch: Watch) -> None:
    watch.after(3)
    watch.time += 3600.0  # this process was stopped, or the machine was suspended
    assert watch.after(1) == []
    assert watch.after(6)[0] == ('silent for 6 s: it hangs', False)


def test_no_node_is_ended_if_the_user_says_so() -> None:
    watch = Watch()
    watch.liveness = Liveness(
        ['hub'], own='supervisor', restart_after_s=0.0, clock=lambda: watch.time
    )
    assert watch.after(5000) == [('silent for 5000 s: it hangs', False)]


def test_strangers_are_not_watched(watch: Watch) -> None:
    watch.liveness.heard('somebody')
    assert [one.name for one in watch.liveness.silent(dict)] == []
    watch.after(10)
    assert [one.name for one in watch.liveness.silent(dict)] == ['hub']
