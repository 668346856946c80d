"""Output of the commands: results on standard output, messages and progress on standard error."""

import json
import logging
import math
import sys
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from porotwin_core.errors import InputError

Json = Annotated[bool, typer.Option('--json', help='Print one JSON object on standard output.')]

PIPE_WIDTH = 120
"""Width of tables that go into a pipe or file [characters], so that no column is cut."""


class WorkFailed(Exception):  # noqa: N818  a state of the work, no mistake of the user
    """The work failed although the input was right (exit status 1); the message is one line."""


def say(text: str) -> None:
    """Print a message on standard error."""
    print(text, file=sys.stderr, flush=True)


def duration_in_words(seconds: float) -> str:
    """Return a duration that a person plans with: in seconds, or in minutes from two on."""
    if seconds < 120.0:
        return f'{max(10, round(seconds, -1)):.0f} s'
    return f'{seconds / 60.0:.0f} min'


class _NewWarnings(logging.Handler):
    """Prints every warning once; a command may read the same rig several times."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._told: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print the message of `record` unless it was printed before."""
        text = record.getMessage()
        if text not in self._told:
            self._told.add(text)
            say(f'porotwin: odd: {text}')


def show_warnings() -> None:
    """Print the warnings of all packages on standard error, each once."""
    logger = logging.getLogger('porotwin')
    logger.addHandler(_NewWarnings())
    logger.propagate = False


def progress() -> AbstractContextManager[Progress]:
    """Return a progress display with an estimate of the remaining time, on standard error."""
    return Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def print_json(result: dict[str, Any]) -> None:
    """Print one JSON object; paths become text, NaN and infinity become null."""
    print(json.dumps(_plain(result), indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_table(title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table on standard output; all columns but the first are aligned to the right."""
    table = Table(title=title, title_justify='left')
    for index, name in enumerate(header):
        table.add_column(escape(name), justify='right' if index else 'left')
    for row in rows:
        table.add_row(*(escape(str(cell)) for cell in row))
    Console(width=None if sys.stdout.isatty() else PIPE_WIDTH).print(table)


def refuse_existing(path: Path) -> None:
    """Check that `path` does not exist, so that nothing is overwritten.

    Raises:
        InputError: `path` exists.
    """
    if path.exists():
        raise InputError(f'{path} exists already; name another output or remove it')
