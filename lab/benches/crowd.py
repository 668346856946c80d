"""Programs of others in the domain of a twin: idle nodes, each alone in its participant of DDS.

As a program, `python -m lab.benches.crowd 10` runs ten of them until its input ends.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import rclpy
from rclpy.context import Context

PER_PROCESS = 10
"""Programs in one process: a process for each would need more memory."""

YIELDS = 10
"""Niceness: their work shall not count."""


@contextmanager
def crowd(programs: int) -> Iterator[None]:
    """Run `programs` idle nodes in the domain of this process until the block ends."""
    with ExitStack() as processes:
        for first in range(0, programs, PER_PROCESS):
            process = processes.enter_context(
                subprocess.Popen(
                    [sys.executable, '-m', __name__, str(min(PER_PROCESS, programs - first))],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                )
            )
            assert process.stdout is not None
            process.stdout.readline()
        yield


def main() -> None:
    """Make the nodes, print a line, and wait for the end of the input."""
    os.nice(YIELDS)
    nodes = []
    for number in range(int(sys.argv[1])):
        context = Context()
        rclpy.init(context=context)
        nodes.append(rclpy.create_node(f'idle_{os.getpid()}_{number}', context=context))
    print(len(nodes), flush=True)
    sys.stdin.read()
    os._exit(0)


if __name__ == '__main__':
    main()
