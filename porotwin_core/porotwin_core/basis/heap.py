"""The heap of a process that runs for days."""

import ctypes
from contextlib import suppress

ARENA_MAX = -8
"""Option M_ARENA_MAX of mallopt (mallopt(3))."""


def share_heap() -> None:
    """Let all threads take their memory from one heap, so that freed memory is used again.

    The C library opens a heap for each thread, up to eight for a core. Arrays of many sizes in many
    threads then leave gaps in all of them, and the process grows for days. Another C library
    than glibc goes on as it is.
    """
    with suppress(AttributeError):
        ctypes.CDLL(None).mallopt(ARENA_MAX, 1)
