"""Many independent tasks at once: on the cores of this machine, or on a Dask cluster.

    with crew(workers=4) as pool:
        maps = list(pool.map(simulate_one, jobs))

A crew is a `concurrent.futures.Executor`. Its `map` keeps the order of the items, and a task gets
nothing but its arguments, so the results do not depend on the number of workers. Each worker works
on one task at a time. The tasks of a worker that dies are done again by the others.
"""

import logging
import os
import socket
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from functools import cache, partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import uuid4

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

Result = TypeVar('Result')
Tell = Callable[[str], None]

TASK_BYTES = 1_000_000_000
"""Memory of one task where the caller knows no better [B]: a simulation with its libraries."""

MOST_WORKERS = 64
"""Workers, or threads, that a node accepts: more than any laboratory machine has cores."""

YIELDING = 10
"""Nice value of work that uses only the time that the twin leaves."""

CONNECT_S = 10.0
"""How long to wait for a scheduler that does not answer [s]."""

AHEAD = 2
"""Tasks per worker that wait beside the running one, so that no worker waits for its next task."""

LOCALHOST = '127.0.0.1'
"""The scheduler of this machine listens here only, because its clients may run programs."""

SETTINGS = {
    # a worker with one task would pause for ever, or write to disk what is needed at once
    'distributed.worker.memory.target': False,
    'distributed.worker.memory.spill': False,
    'distributed.worker.memory.pause': False,
    # a photograph of 36 megapixels is no mistake
    'distributed.admin.large-graph-warning-threshold': '1 GB',
}
"""Settings of Dask for few long tasks, in place of its own for many short ones."""

MEMORY_FILES = ('/sys/fs/cgroup/memory.max', '/sys/fs/cgroup/memory.current')
"""Limit and use of the memory of a container [B]."""

TABLES = '/info/main/workers.html'
"""Page of a scheduler without the library Bokeh, which draws the pictures of a dashboard."""

LIBRARIES = ('numpy', 'scipy', 'numba')
"""Libraries whose versions change the last bits of results."""


class SchedulerLost(ConnectionError):  # noqa: N818  a state of the cluster, no mistake
    """The scheduler, or a worker again and again, went away; the message is one line."""


class Crew(Executor):
    """Workers for independent tasks; leaving its context cancels the tasks that have not begun.

    Attributes:
        workers: tasks at a time; for a cluster, the number when it was first reached.
    """

    workers: int = 1

    def share(self, value: Any) -> Any:
        """Return a short form of `value` for the arguments of many tasks, sent once per worker."""
        return value

    def needs_folder(self, folder: Path) -> None:
        """Check that all workers see the files in the existing `folder`.

        Raises:
            InputError: a worker is on a machine without it.
        """

    def threads(self, count: int) -> Executor:
        """Return `count` threads here for work that waits for tasks of this crew."""
        return ThreadPoolExecutor(count)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> bool | None:
        """End the crew."""
        self.shutdown(wait=True, cancel_futures=True)
        return None


class ThreadCrew(Crew, ThreadPoolExecutor):
    """Threads of this process, for tasks that spend their time in compiled code."""

    def __init__(self, workers: int, initializer: Callable[[], None] | None = None) -> None:
        """Prepare `workers` threads; each calls `initializer` once."""
        ThreadPoolExecutor.__init__(self, workers, initializer=initializer)
        self.workers = workers


class ClusterCrew(Crew):
    """Processes under a Dask scheduler, on this machine or others.

    Dask's own executor, `Client.get_executor`, was read: it cancels the futures of a scheduler
    that went away, as if their user had cancelled them, so every future would need a second one.
    """

    def __init__(self, client: 'Client', address: str, own: 'LocalCluster | None' = None) -> None:
        """Use `client` of the scheduler at `address`; the crew ends the cluster `own`, if any."""
        self._client, self._address, self._own = client, address, own
        self._tasks: dict[Any, Future[Any]] = {}
        self.workers = max(1, len(client.scheduler_info(n_workers=-1)['workers']))

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of `function(*args, **kwargs)`; all of it must be picklable.

        Its exception is that of the function, or SchedulerLost.

        Raises:
            SchedulerLost: the scheduler is gone.
        """
        future: Future[Any] = Future()
        call = partial(function, **kwargs) if kwargs else function
        if self._client.status != 'running':
            raise self._lost()
        task = self._client.submit(_in_worker, versions(), call, *args, pure=False)
        self._tasks[task] = future
        task.add_done_callback(self._deliver)
        return future

    def share(self, value: Any) -> Any:
        """Return a reference to `value`, which every worker fetches once; only for arguments."""
        return self._client.scatter(value, hash=False)

    def needs_folder(self, folder: Path) -> None:
        """Check that all workers see the files in the existing `folder`.

        Raises:
            InputError: a worker is on a machine without it.
        """
        if self._own is not None:
            return
        mark = folder.resolve() / f'.{uuid4().hex}'
        mark.touch()
        try:
            seen = self._client.run(os.path.exists, str(mark))
        finally:
            mark.unlink()
        blind = [address for address, sees in seen.items() if not sees]
        if blind:
            raise InputError(
                f'{folder}: {len(blind)} of {len(seen)} workers do not see this folder, such as '
                f'{blind[0]}; put it on a file system that all machines share'
            )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the crew; `wait` for its tasks, or cancel those that have not begun."""
        tasks = dict(self._tasks)
        if cancel_futures:
            for future in tasks.values():
                future.cancel()
            if tasks and self._client.status == 'running':
                self._client.cancel(list(tasks), force=True)
        elif wait:
            wait_for(tasks.values())
        self._client.close(timeout=CONNECT_S)
        if self._own is not None:
            self._own.close(timeout=CONNECT_S)

    def _deliver(self, task: Any) -> None:
        """Give the outcome of a Dask task to its future."""
        future = self._tasks.pop(task)
        if not future.set_running_or_notify_cancel():
            return
        try:
            future.set_result(task.result())
        except BaseException as error:  # of the function, or of the cluster
            future.set_exception(self._reason(error))

    def _reason(self, error: BaseException) -> BaseException:
        """Return the exception that the user of a future sees for `error`."""
        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        if isinstance(error, KilledWorker):
            return SchedulerLost(
                f'a task ended {error.allowed_failures + 1} workers, the last one '
                f'{error.last_worker.address}; it may need more memory than a worker has'
            )
        if isinstance(error, CommClosedError | CancelledError):
            return self._lost()
        return error

    def _lost(self) -> SchedulerLost:
        return SchedulerLost(
            f'scheduler {self._address}: went away; what is on disk is kept, and the same command '
            'goes on from there'
        )


class LastingCrew(Crew):
    """A crew that a second crew replaces when the scheduler of the first one goes away."""

    def __init__(self, first: Crew, second: Callable[[], Executor], tell: Tell) -> None:
        """Begin with `first`; make the `second` one when it is needed, and `tell` so."""
        self._present: Executor = first
        self._second, self._tell = second, tell
        self.workers = first.workers

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of `function(*args, **kwargs)`.

        Tasks that the scheduler had when it went away fail with SchedulerLost.
        """
        try:
            return self._present.submit(function, *args, **kwargs)
        except SchedulerLost as error:
            self._tell(f'{error}; from now on this machine does the work')
            self._present = self._second()
            return self._present.submit(function, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the present crew."""
        self._present.shutdown(wait=wait, cancel_futures=cancel_futures)


def crew(
    *,
    workers: int | None = None,
    scheduler: str = '',
    threads: bool = False,
    task_bytes: float = TASK_BYTES,
    tell: Tell = lambda _: None,
) -> Crew:
    """Return workers for independent tasks; use it in a `with` statement.

    Args:
        workers: tasks at a time on this machine; None for one per core. The memory that is free
            now bounds it.
        scheduler: address of a Dask scheduler whose workers do the tasks instead.
        threads: use threads of this process. They suffice for tasks in compiled code that read no
            netCDF files.
        task_bytes: memory of one task [B].
        tell: called with a line about the workers and the address of their dashboard.

    Raises:
        InputError: no scheduler answers at that address, or `workers` is given for a cluster.
    """
    if scheduler:
        if workers is not None:
            raise InputError(
                f'--workers {workers}: counts tasks of this machine, and --scheduler names a '
                'cluster; leave one of them out'
            )
        return _cluster_at(scheduler, tell)
    if not (threads or find_spec('distributed')):
        tell('one task at a time: Dask, of the extra cluster, is not installed')
        return ThreadCrew(1)
    count = workers_that_fit(workers, task_bytes, tell)
    return ThreadCrew(count) if threads else _own_processes(count, tell)


def in_order(
    pool: Executor,
    function: Callable[..., Result],
    items: Iterable[Any],
    *,
    first: tuple[Any, ...] = (),
    ahead: int = 0,
) -> Iterator[Result]:
    """Yield `function(*first, item)` in the order of `items`; few items are in work at a time.

    `pool.map` takes all items at once. This function takes at most `ahead` items before their
    results are wanted (0: a few per worker). So thousands of photographs need the memory of a few.
    Pass large objects in `first` through `Crew.share`.
    """
    most = ahead or (1 + AHEAD) * getattr(pool, 'workers', os.cpu_count() or 1)
    waiting: deque[Future[Result]] = deque()
    for item in items:
        waiting.append(pool.submit(function, *first, item))
        if len(waiting) >= most:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def workers_that_fit(
    workers: int | None, task_bytes: float, tell: Tell = lambda _: None, free: float | None = None
) -> int:
    """Return how many tasks this machine does at a time: `workers`, or one per core.

    The number is smaller, but at least one, if the `free` memory [B] (None: as it is now) does not
    hold that many tasks of `task_bytes` [B] each. Then `tell` gets a line.
    """
    asked = workers or _cores()
    room = free_memory() if free is None else free
    count = max(1, min(asked, int(room // task_bytes)))
    if count < asked:
        tell(
            f'{count} at a time, not {asked}: {room / 1e9:.1f} GB are free, and each needs about '
            f'{task_bytes / 1e9:.1f} GB'
        )
    return count


def free_memory(files: tuple[str, str] = MEMORY_FILES) -> float:
    """Return the free memory [B] of this machine, or of the container if that is less.

    `files` hold the limit and the use of a container's memory.
    """
    import psutil

    free = float(psutil.virtual_memory().available)
    try:
        limit, used = (Path(file).read_text(encoding='ascii').strip() for file in files)
    except OSError:  # no container
        return free
    return free if limit == 'max' else min(free, float(limit) - float(used))


def _cores() -> int:
    """Return the cores that this process may use, as its container allows."""
    if not find_spec('dask'):
        return os.cpu_count() or 1
    from dask.system import CPU_COUNT

    return int(CPU_COUNT)


def _own_processes(count: int, tell: Tell) -> Crew:
    """Return `count` processes of this machine under a scheduler of their own."""
    import dask
    from distributed import Client, LocalCluster
    from distributed.system import MEMORY_LIMIT

    _be_quiet()
    dask.config.set(SETTINGS)
    own = LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        host=LOCALHOST,
        dashboard_address=f'{LOCALHOST}:0',
        memory_limit=MEMORY_LIMIT // count,
        silence_logs=logging.CRITICAL,
    )
    made = ClusterCrew(Client(own, set_as_default=False), own.scheduler_address, own)
    tell(f'{count} at a time on this machine; dashboard: {_page(own.dashboard_link)}')
    return made


def _cluster_at(scheduler: str, tell: Tell) -> Crew:
    """Return the workers of the Dask `scheduler`.

    Raises:
        InputError: no scheduler answers there.
    """
    import dask
    from distributed import Client
    from distributed.comm.addressing import parse_address, parse_host_port

    _be_quiet()
    dask.config.set(SETTINGS)
    try:
        _, address = parse_address(scheduler)
        socket.create_connection(parse_host_port(address), timeout=CONNECT_S).close()
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"scheduler '{scheduler}': {reason}; start `dask scheduler` there, or see "
            'docs/cluster.md'
        ) from None
    made = ClusterCrew(client, scheduler)
    count = len(client.scheduler_info(n_workers=-1)['workers'])
    some = f'{count} workers' if count else 'no workers yet, waiting for them'
    tell(f'scheduler {scheduler}: {some}; dashboard: {_page(client.dashboard_link)}')
    return made


def _page(dashboard: str) -> str:
    """Return the address of the page of a scheduler; without Bokeh it has tables only."""
    return dashboard if find_spec('bokeh') else dashboard.replace('/status', TABLES)


def _be_quiet() -> None:
    """Keep the log of Dask from the terminal; what matters is said in one line.

    Dask gives levels of their own to some of its loggers when it is imported.
    """
    for name in ('asyncio', *logging.root.manager.loggerDict):
        if name.split('.')[0] in ('asyncio', 'distributed'):
            logging.getLogger(name).setLevel(logging.CRITICAL)


@cache
def versions() -> str:
    """Return this program and the versions that its results depend on."""
    found = [f'{name} {version(name)}' for name in LIBRARIES]
    return ', '.join([PROGRAM, f'Python {sys.version_info.major}.{sys.version_info.minor}', *found])


def _in_worker(wanted: str, function: Callable[..., Result], /, *args: Any) -> Result:
    """Return `function(*args)`, computed in a worker as it would be computed here.

    Raises:
        InputError: the worker has other versions, or several threads.
    """
    from distributed import get_worker

    worker = get_worker()
    if wanted != versions():
        raise InputError(
            f'worker {worker.address} has {versions()}; this machine has {wanted}: install the '
            'same on both'
        )
    if worker.state.nthreads > 1:
        raise InputError(
            f'worker {worker.address} has {worker.state.nthreads} threads, and some libraries '
            'work with one only; start it with `dask worker --nthreads 1`'
        )
    if 'cv2' in sys.modules:  # the workers share the cores
        sys.modules['cv2'].setNumThreads(1)
    return function(*args)
