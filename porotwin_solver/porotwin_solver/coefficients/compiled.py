"""How the kernels are compiled, and the concentration below which they treat a cell as empty."""

from collections.abc import Callable
from typing import Any

from numba import njit

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

compiled: Decorator = njit(cache=True, nogil=True, error_model='numpy')
"""Compile once per machine, release the interpreter's lock, divide by zero as NumPy does."""

inlined: Decorator = njit(inline='always', nogil=True, error_model='numpy')
"""Compile into the calling kernel: a call with many arrays counts references to each of them."""

NEGLIGIBLE = 1e-15
"""Concentration [-] below which a cell sends no tracer to its neighbours.

It is the round-off of the stock concentration 1. It keeps the plume's tails short. The tracer stays
in the cell, so nothing is lost.
"""
