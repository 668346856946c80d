"""A peer that a test tells how to behave."""

import os
import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lab.benches.peers.child import Problem


def version() -> str:
    """Return a version."""
    return '1.2'


def prepare(problem: Problem) -> Callable[[], NDArray[np.float64]]:
    """Return the work that `problem` asks for."""
    works: dict[str, Callable[[], NDArray[np.float64]]] = {
        'doubles': lambda: 2.0 * problem['numbers'],
        'raises': lambda: np.array(1 // int(problem['numbers'].size * 0)),
        'dies': os.abort,
        'hangs': lambda: np.array(threading.Event().wait(600.0)),
    }
    return works[str(problem['does'])]
