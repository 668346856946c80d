"""Schedules whose times are known, and the trace of work that hands out tasks."""

import pytest

from lab.scaling.simulated_schedule import (
    HANDING_S,
    LATENCY_S,
    handing_seconds,
    longest_chain,
    simulated_seconds,
)
from lab.scaling.task_trace import Away, Here, Strand, TraceCrew

TASK = Away(1.0)


def fork(count: int) -> Strand:
    return Strand([[Strand([TASK]) for _ in range(count)]])


@pytest.mark.parametrize(('workers', 'rounds'), [(1, 6), (2, 3), (4, 2), (6, 1), (64, 1)])
def test_equal_tasks_take_rounds(workers: int, rounds: int) -> None:
    found = simulated_seconds(fork(6), workers)
    assert found == pytest.approx(rounds * (1.0 + LATENCY_S), abs=7.0 * HANDING_S)


def test_steps_wait_for_each_other() -> None:
    chain = Strand([Here(0.5), TASK, TASK, *fork(3).steps, Here(0.25)])
    assert longest_chain(chain) == pytest.approx(3.75)
    assert simulated_seconds(chain, 64) == pytest.approx(3.75, abs=0.02)
    assert chain.tasks == 5


def test_work_here_is_done_one_after_the_other() -> None:
    strands = Strand([[Strand([Here(1.0), TASK]) for _ in range(4)]])
    assert handing_seconds(strands) == pytest.approx(4.0, abs=0.01)
    assert simulated_seconds(strands, 64) == pytest.approx(5.0, abs=0.02)


def test_a_large_argument_takes_its_time_on_the_cable() -> None:
    assert simulated_seconds(Strand([Away(1.0, 1.1e8)]), 1) == pytest.approx(2.0, abs=0.01)


def test_the_trace_has_the_forks_of_the_work() -> None:
    tracer = TraceCrew()
    assert tracer.submit(abs, -1).result() == 1
    with tracer.threads(2) as threads:
        found = list(threads.map(lambda n: tracer.submit(pow, n, 2).result(), range(3)))
    assert found == [0, 1, 4]
    trace = tracer.finish()
    assert trace.tasks == 4
    kinds = [type(step) for step in trace.steps if not isinstance(step, Here)]
    assert kinds == [Away, list]
    assert isinstance(trace.steps[0], Here)
