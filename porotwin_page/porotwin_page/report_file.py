"""The file of a report whose path came in a message: a regular file of that name, or nothing."""

import os
import stat
from pathlib import Path

REPORT = 'report.html'
"""Name of a report on a diagnosis: the only files that an offer may point to."""


def read_report(path: Path) -> str:
    """Return the text of the report `path`; never wait for it.

    Raises:
        OSError: it is no regular file with the name of a report, or cannot be read.
        ValueError: it is no text.
    """
    if path.name != REPORT:
        raise FileNotFoundError
    # without O_NONBLOCK a FIFO would keep this thread until somebody writes into it
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
    with os.fdopen(descriptor, encoding='utf-8') as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise FileNotFoundError
        return file.read()
