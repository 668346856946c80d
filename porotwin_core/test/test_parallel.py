"""Crews: the same results from any number of workers, and nothing lost with a worker."""

import os
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from porotwin_core.basis import parallel
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import (
    Crew,
    LastingCrew,
    SchedulerLost,
    ThreadCrew,
    crew,
    free_memory,
    in_order,
    workers_that_fit,
)

NUMBERS = range(7)


def walk(number: int) -> np.ndarray:
    """Return sums whose last bits depend on the order of the additions."""
    return np.cumsum(np.random.default_rng(number).normal(size=1000))


def die_once(mark: Path, number: int) -> int:
    """End the process of the worker, but only in the first call of all."""
    try:
        mark.touch(exist_ok=False)
    except FileExistsError:
        return number**2
    os._exit(1)


@pytest.fixture(scope='module')
def told() -> list[str]:
    """The lines about the crew."""
    return []


@pytest.fixture(scope='module')
def processes(told: list[str]) -> Iterator[Crew]:
    """Two processes, which start once for all tests."""
    with crew(workers=2, task_bytes=1.0, tell=told.append) as pool:
        yield pool


def test_processes_and_threads_give_the_same_bits_in_order(processes: Crew) -> None:
    with crew(workers=1, threads=True) as one, crew(workers=3, threads=True) as three:
        found = [list(pool.map(walk, NUMBERS)) for pool in (one, three, processes)]
    np.testing.assert_array_equal(found[0], [walk(number) for number in NUMBERS])
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_without_dask_one_task_runs_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr(parallel, 'find_spec', lambda _: None)
    with crew(workers=3, tell=told.append) as pool:
        assert (pool.workers, list(pool.map(abs, [-1, -2]))) == (1, [1, 2])
    assert 'extra cluster' in told[0]
    assert workers_that_fit(None, 1.0) == os.cpu_count()


def test_a_worker_that_dies_loses_nothing(processes: Crew, tmp_path: Path) -> None:
    marks = [tmp_path / 'mark'] * len(NUMBERS)
    assert list(processes.map(die_once, marks, NUMBERS)) == [number**2 for number in NUMBERS]
    assert marks[0].exists()


def test_the_address_of_the_dashboard_is_said(processes: Crew, told: list[str]) -> None:
    assert processes.workers == 2
    assert len(told) == 1
    assert 'dashboard: http://127.0.0.1:' in told[0]


def test_an_error_of_a_task_is_the_error_of_its_future(processes: Crew) -> None:
    with pytest.raises(ValueError, match='invalid literal'):
        processes.submit(int, 'four').result()


def test_a_shared_value_arrives_whole(processes: Crew) -> None:
    table = processes.share({'seven': 7})
    assert processes.submit(dict.get, table, 'seven').result() == 7


def test_items_are_taken_only_when_they_are_needed() -> None:
    taken = []

    def items() -> Iterator[int]:
        for number in NUMBERS:
            taken.append(number)
            yield number

    with crew(workers=2, threads=True) as pool:
        results = in_order(pool, str, items(), ahead=3)
        assert next(results) == '0'
        assert taken == [0, 1, 2]
        assert list(results) == ['1', '2', '3', '4', '5', '6']


@pytest.fixture
def cluster() -> Iterator[LocalCluster]:
    """A scheduler with one worker, both in this process."""
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol='tcp', host='127.0.0.1',
        dashboard_address=None,
    ) as made:  # fmt: skip
        yield made


def test_a_cluster_does_the_work(cluster: LocalCluster, tmp_path: Path) -> None:
    lines: list[str] = []
    with crew(scheduler=cluster.scheduler_address, tell=lines.append) as pool:
        pool.needs_folder(tmp_path)
        assert list(pool.map(abs, (-1, 2))) == [1, 2]
    assert lines[0].startswith(f'scheduler {cluster.scheduler_address}: 1 workers')
    assert not list(tmp_path.iterdir())


def test_a_scheduler_that_goes_away_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    cluster = LocalCluster(
        n_workers=0, processes=False, protocol='tcp', host='127.0.0.1', dashboard_address=None
    )
    with cluster, crew(scheduler=cluster.scheduler_address) as pool:
        future = pool.submit(abs, -1)  # no worker takes it
        cluster.close()
        with pytest.raises(SchedulerLost, match='went away') as caught:
            future.result(timeout=60)
    assert '\n' not in str(caught.value)
    assert capfd.readouterr().err == ''
    assert isinstance(caught.value, OSError)  # so that commands end with status 1


def test_threads_take_over_when_a_scheduler_goes_away() -> None:
    class Lost(ThreadCrew):
        def submit(self, *_: object, **__: object) -> Future[object]:
            raise SchedulerLost('scheduler tcp://head:8786: went away')

    lines: list[str] = []
    with LastingCrew(Lost(1), lambda: ThreadCrew(1), lines.append) as pool:
        assert list(pool.map(abs, (-1, 2))) == [1, 2]
    assert len(lines) == 1
    assert 'this machine does the work' in lines[0]


def test_no_scheduler_is_one_line() -> None:
    with pytest.raises(InputError, match=r"scheduler 'tcp://127.0.0.1:1': .*; start"):
        crew(scheduler='tcp://127.0.0.1:1')


def test_workers_are_those_of_this_machine() -> None:
    with pytest.raises(InputError, match='leave one of them out'):
        crew(workers=2, scheduler='tcp://127.0.0.1:1')


def test_memory_bounds_the_workers() -> None:
    lines: list[str] = []
    assert workers_that_fit(8, 2e9, lines.append, free=7e9) == 3
    assert lines == ['3 at a time, not 8: 7.0 GB are free, and each needs about 2.0 GB']
    assert workers_that_fit(8, 2e9, lines.append, free=1e9) == 1
    assert workers_that_fit(2, 2e9, lines.append, free=1e12) == 2
    assert len(lines) == 2


def test_a_container_bounds_the_memory(tmp_path: Path) -> None:
    limit, used = tmp_path / 'max', tmp_path / 'current'
    limit.write_text('3000\n')
    used.write_text('1000\n')
    assert free_memory((str(limit), str(used))) == 2000.0
    limit.write_text('max\n')
    assert free_memory((str(limit), str(used))) > 1e6
