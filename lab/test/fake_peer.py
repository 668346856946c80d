"""A peer that a test tells how to behave."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.benches.peers.child import RESULT, Problem


def version() -> str:
    """Return a version."""
    return '1.2'


def prepare(problem: Problem) -> Callable[[], NDArray[np.float64]]:
    """Return the work that `problem` asks for."""
    works: dict[str, Callable[[], NDArray[np.float64]]] = {
        'doubles': lambda: 2.0 * problem['numbers'],
        'raises': lambda: np.array(1 // int(problem['numbers'].size * 0)),
        'dies': os.abort,
        'leaves': _leave,
        'spoils': _spoil,
        'hangs': lambda: np.array(threading.Event().wait(600.0)),
    }
    return works[str(problem['does'])]


def _leave() -> NDArray[np.float64]:
    """Die while a program that was called holds the error stream open."""
    subprocess.Popen(['sleep', '600'])
    os.abort()


def _spoil() -> NDArray[np.float64]:
    """Leave a damaged result, as a full disk does."""
    Path(sys.argv[2], RESULT).write_bytes(b'PK damaged')
    os._exit(0)
