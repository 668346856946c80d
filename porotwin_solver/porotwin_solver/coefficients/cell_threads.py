"""Threads that share the cells of a large grid.

A kernel gets a range of rows or of cells, and writes into these alone. So the results do not depend
on the number of threads, to the last bit. Sums over all cells come from the sums of fixed parts.
Kernels release the interpreter's lock. Numba's own threads are not used: on some machines they end
the process where several simulations run at the same time.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from porotwin_core.geometry.grid import FloatArray

THREADED_CELLS = 250_000
"""Cells from which threads pay: a part then takes ten times as long as handing it over."""

BLOCK_CELLS, MOST_BLOCKS = 8192, 64
"""Least cells of a part of a sum, and most parts: they do not depend on the number of threads. A
part of so many cells takes ten times as long as its call."""

PARTS_PER_THREAD = 4
"""Parts of the rows for each thread: rows with tracer take longer than others."""

LIMIT = 'OMP_NUM_THREADS'
"""Environment variable that bounds the threads of a process, as for other numerical libraries."""


def most_threads() -> int:
    """Return the threads of this process: one per core that it may use, or as `LIMIT` says."""
    limit = os.environ.get(LIMIT, '')
    if limit.isdecimal() and int(limit) > 0:
        return int(limit)
    return len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1


@contextmanager
def at_most(threads: int) -> Iterator[None]:
    """Let simulations in this process use so many threads, until the end of the block."""
    before = os.environ.get(LIMIT)
    os.environ[LIMIT] = str(threads)
    try:
        yield
    finally:
        if before is None:
            del os.environ[LIMIT]
        else:
            os.environ[LIMIT] = before


def in_rows(kernel: Callable[..., None], rows: int, cells: int, *args: Any) -> None:
    """Call `kernel(*args, first, last)` so that all ranges together are the `rows`.

    `cells` is their number of cells; few are done at once.
    """
    threads = most_threads() if cells >= THREADED_CELLS else 1
    if threads == 1:
        kernel(*args, 0, rows)
        return
    parts = min(PARTS_PER_THREAD * threads, rows)
    ends = [rows * part // parts for part in range(parts + 1)]
    side_by_side(kernel, [(*args, *ends[part : part + 2]) for part in range(parts)])


def in_blocks(
    kernel: Callable[..., None], cells: int, args: tuple[Any, ...], total: FloatArray | None = None
) -> None:
    """Call `kernel(*args, [part,] first, last)` for all blocks among `cells`.

    With `total` (n,), every call gets zeros (n,) as `part`, and `total` grows by their sum. It is
    the same for any number of threads, because the blocks do not depend on it.
    """
    block = max(BLOCK_CELLS, -(-cells // MOST_BLOCKS))
    starts = range(0, cells, block)
    ends = [min(start + block, cells) for start in starts]
    parts = [] if total is None else [np.zeros(len(total)) for _ in starts]
    calls: list[tuple[Any, ...]] = [
        (*args, *parts[number : number + 1], start, end)
        for number, (start, end) in enumerate(zip(starts, ends, strict=True))
    ]
    side_by_side(kernel, calls)
    if total is not None:
        for part in parts:
            total += part


def side_by_side(kernel: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> None:
    """Call `kernel` with each of the arguments, in threads; return after the last call.

    The calling thread works too. Another one takes the next call when it has ended one.
    """
    left = iter(calls)

    def work() -> None:
        for call in left:
            kernel(*call)

    others = min(most_threads(), len(calls)) - 1
    helpers = [_pool(most_threads()).submit(work) for _ in range(others)]
    try:
        work()
    finally:  # after Ctrl-C too: no thread writes later
        for helper in helpers:
            if not helper.cancel():  # one that has not begun has nothing left to do
                helper.result()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Return the threads that all simulations of this process share."""
    return ThreadPoolExecutor(threads, thread_name_prefix='cells')
