"""The agreement of a node and its launcher: the launching process, and the refusal to run."""

import ctypes
import os
import signal
import sys

PARENT = 'POROTWIN_PARENT'
"""Environment variable with the number of the process that started this one."""

REFUSAL = 'error: '
"""A node refuses its parameters with a line that begins with this."""

WRONG_PARAMETERS = 2
"""Exit status of a node whose parameters are wrong: a restart would change nothing."""

_PR_SET_PDEATHSIG = 1
"""Option of Linux' prctl(2): the signal to receive when the parent ends."""


def end_with_parent() -> None:
    """Let Linux end this process when its parent ends, cleanly or not.

    Without the environment variable `PARENT`, or on another system, nothing happens. The kernel
    watches the thread that started this process, so that thread must live as long as the process.
    The request is made here rather than between fork and exec, where a program with threads may do
    little.
    """
    parent = os.environ.get(PARENT)
    if parent is None or sys.platform != 'linux':
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if launcher_is_gone():  # it ended while this process was starting
        sys.exit(1)


def launcher_is_gone() -> bool:
    """Return whether the process that started this one, named by `PARENT`, has ended."""
    parent = os.environ.get(PARENT)
    return parent is not None and str(os.getppid()) != parent
