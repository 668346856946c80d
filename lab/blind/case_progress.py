"""How far a case has come: its worker writes a small file, and the check reads it.

A worker may be a process on another machine, so a file in the folder of the case is all they share.
"""

import time
from collections.abc import Callable
from pathlib import Path

from porotwin_core.basis.whole_file import write_whole

FILE = 'progress.txt'
"""File with the share of the work on a case that is done, while it is in work."""

WRITE_EACH_S = 1.0
"""Least time between two writings [s]."""

Share = Callable[[float], None]
"""Called with the share of the work that is done, 0 to 1."""


def no_share(_share: float) -> None:
    """Ignore the progress."""


def part_of(progress: Share, begin: float, end: float) -> Share:
    """Return the progress of a part of the work, which takes it from `begin` to `end` [-]."""
    return lambda share: progress(begin + (end - begin) * min(max(share, 0.0), 1.0))


class CaseProgress:
    """Writes the progress of the case in `folder`; the file is gone at the end of the context."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / FILE
        self._written = -WRITE_EACH_S

    def __call__(self, share: float) -> None:
        """Write the share of the work that is done, unless it was written just now."""
        if time.monotonic() - self._written < WRITE_EACH_S:
            return
        self._written = time.monotonic()
        self._file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(self._file, f'{share:.4f}\n')

    def __enter__(self) -> 'CaseProgress':
        return self

    def __exit__(self, *_: object) -> None:
        self._file.unlink(missing_ok=True)


def share_done(folder: Path) -> float:
    """Return the share of the case in `folder` that is done, while it is in work."""
    try:
        return float((folder / FILE).read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return 0.0
