"""The file of a report whose path came in a message: a regular file of that name, or nothing."""

from pathlib import Path

from porotwin_core.basis.regular_file import open_regular

REPORT = 'report.html'
"""Name of a report on a diagnosis: the only files that an offer may point to."""


def read_report(path: Path) -> str:
    """Return the text of the report `path`; never wait for it.

    Raises:
        OSError: it has not the name of a report, or cannot be read.
        ValueError: it is no regular file, or no text.
    """
    if path.name != REPORT:
        raise FileNotFoundError
    with open_regular(path, links=False) as file:
        return file.read().decode()
