"""Processes that must not outlive the one that started them."""

import ctypes
import os
import signal
import sys

PARENT = 'POROTWIN_PARENT'
"""Environment variable: number of the process that started this one and must outlive it."""

_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """Have Linux end this process when the one that `PARENT` names ends, however that happens.

    The kernel watches the thread that started this process, so that thread has to live as long.
    Asked for here and not between fork and exec, where a program with threads may do little.
    """
    parent = os.environ.get(PARENT)
    if parent is None or sys.platform != 'linux':
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):  # it ended while this process was starting
        sys.exit(1)
