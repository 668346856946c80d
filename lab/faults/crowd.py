"""Programs of others in the domain of a twin: idle nodes, each alone in its participant of DDS."""

import multiprocessing
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.context import Context

PER_PROCESS = 10
"""Programs in one process: a process for each would need more memory."""

YIELDS = 10
"""Niceness: what they compute shall not count."""


@contextmanager
def crowd(programs: int) -> Iterator[None]:
    """Run `programs` idle nodes in the domain of this process until the block ends."""
    spawn = multiprocessing.get_context('spawn')
    ready, end = spawn.Semaphore(0), spawn.Event()
    processes = [
        spawn.Process(target=_idle, args=(min(PER_PROCESS, programs - first), ready, end))
        for first in range(0, programs, PER_PROCESS)
    ]
    for process in processes:
        process.start()
    try:
        for _ in range(programs):
            ready.acquire()
        yield
    finally:
        end.set()
        for process in processes:
            process.join()


def _idle(programs: int, ready: Any, end: Any) -> None:
    """Make nodes, release `ready` for each, and wait for `end`."""
    os.nice(YIELDS)
    nodes = []
    for number in range(programs):
        context = Context()
        rclpy.init(context=context)
        nodes.append(rclpy.create_node(f'idle_{os.getpid()}_{number}', context=context))
        ready.release()
    end.wait()
    os._exit(0)
