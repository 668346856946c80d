"""Output of the commands: results on standard output, messages and progress on standard error."""

import json
import logging
import shlex
import sys
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console, JustifyMethod
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
)
from rich.table import Table
from rich.text import Text

from porotwin_core.basis.errors import InputError, check_writable
from porotwin_core.basis.json_text import plain_json
from porotwin_core.basis.plain_text import plain

Json = Annotated[bool, typer.Option('--json', help='Print one JSON object on standard output.')]

SPEED_OVER_S = 900.0
"""Time over which the speed of progress is averaged [s]. Work comes in pieces of some minutes, and
an average over half a minute changed the estimate tenfold."""

LINE_EACH_S = 30.0
"""Time between two lines of progress where no terminal can show a bar [s]."""

STAGE_AFTER_S = 5.0
"""The same for a new stage of the work [s]: short work prints no line."""

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
        text = plain(record.getMessage())
        if text not in self._told:
            self._told.add(text)
            say(f'porotwin: odd: {text}')


def show_warnings() -> None:
    """Print the warnings of all packages on standard error, each once."""
    warnings.filterwarnings('ignore', 'Glyph .* missing from')  # a box in the picture shows it
    logger = logging.getLogger('porotwin')
    logger.addHandler(_NewWarnings())
    logger.propagate = False


class _Gathered(logging.Handler):
    """Keeps every warning once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the message of `record`."""
        if record.getMessage() not in self.texts:
            self.texts.append(record.getMessage())


@contextmanager
def gathered_warnings() -> Iterator[list[str]]:
    """Gather the warnings of the block in a list instead of printing them."""
    logger, handler = logging.getLogger('porotwin'), _Gathered()
    shown, logger.handlers = logger.handlers, [handler]
    try:
        yield handler.texts
    finally:
        logger.handlers = shown


@contextmanager
def without_warnings() -> Iterator[None]:
    """Leave out the warnings of the block."""
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)


def progress() -> AbstractContextManager[Progress]:
    """Return a progress display with an estimate of the remaining time, on standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        return _ProgressLines(console=console, transient=True, speed_estimate_period=SPEED_OVER_S)
    return Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        _TimeLeft(),
        console=console,
        transient=True,
        speed_estimate_period=SPEED_OVER_S,
    )


KNOWN_FROM_PERCENT, KNOWN_FROM_S = 4.0, 300.0
"""Share of a task, and time since its begin, from either of which on its end is estimated."""


def seconds_left(task: Task) -> float | None:
    """Return the remaining time of a task [s]; None if nothing tells it.

    It is the larger one of two estimates: by the speed of the last steps, and by the mean speed
    since the beginning. Only the second one grows while a long stage makes no step.
    """
    recent, elapsed = task.time_remaining, task.elapsed
    if recent is None or not elapsed or not task.completed:
        return recent
    return max(recent, elapsed * (task.remaining or 0.0) / task.completed)


def left_in_words(task: Task) -> str:
    """Return the remaining time of a task, such as "2 min left"; empty where it is unknown.

    A task that knows it tells it by its field `left`, a function. Of others it is unknown at the
    very beginning, where the time to start would count as slow work.
    """
    if 'left' in task.fields:
        return str(task.fields['left']())
    if task.percentage < KNOWN_FROM_PERCENT and (task.elapsed or 0.0) < KNOWN_FROM_S:
        return ''
    left = seconds_left(task)
    return f'{duration_in_words(left)} left' if left and task.remaining else ''


class _TimeLeft(ProgressColumn):
    """The remaining time, as h:mm:ss or in words."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        """Return the column of `task`."""
        if 'left' in task.fields:
            return Text(left_in_words(task) or '-:--:--')
        left = seconds_left(task)
        return Text('-:--:--' if left is None else str(timedelta(seconds=round(left))))


class _ProgressLines(Progress):
    """Progress in a file: a line each half minute, and for a new stage after some seconds."""

    _told_s = 0.0
    _stage = ''

    def start(self) -> None:
        """Begin; the first line comes after the first interval."""
        self._told_s = self.get_time()
        super().start()

    def update(self, task_id: TaskID, **changes: Any) -> None:
        """Change a task, and print a line if it is time."""
        super().update(task_id, **changes)
        self._tell(task_id)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """Advance a task, and print a line if it is time."""
        super().advance(task_id, advance)
        self._tell(task_id)

    def _tell(self, task_id: TaskID) -> None:
        task = next(task for task in self.tasks if task.id == task_id)
        passed = self.get_time() - self._told_s
        if passed < (LINE_EACH_S if task.description == self._stage else STAGE_AFTER_S):
            return
        self._told_s, self._stage = self.get_time(), task.description
        left = left_in_words(task)
        say(f'{task.description}: {task.percentage:.0f} %{f", {left}" if left else ""}')


def print_json(result: dict[str, Any]) -> None:
    """Print one JSON object; paths become text, NaN and infinity become null."""
    print(json.dumps(plain_json(result), indent=2))


def print_table(
    title: str,
    header: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    whole: Collection[str] = (),
) -> None:
    """Print a table on standard output; all columns but the first are aligned to the right.

    Cells of the first column, and of those whose title is in `whole`, are not broken at spaces. In
    a file or a pipe, no word is broken.
    """
    cells = [[str(cell) for cell in row] for row in rows]
    table = Table(title=escape(title), title_justify='left')
    is_file = not sys.stdout.isatty()
    for number, column in enumerate(zip(header, *cells, strict=True)):
        # a name that does not fit goes on in the next line; it is never cut
        justify: JustifyMethod = 'right' if number else 'left'
        longest = max(map(len, ' '.join(column).split()), default=0)
        table.add_column(
            escape(column[0]),
            justify=justify,
            overflow='fold',
            no_wrap=not number or column[0] in whole,
            min_width=longest if is_file else None,
        )
    for row in cells:
        table.add_row(*map(escape, row))
    Console(width=PIPE_WIDTH if is_file else None).print(table, crop=not is_file)


def as_argument(path: Path) -> str:
    """Return `path` as a word of a command to copy."""
    return shlex.quote(f'./{path}' if str(path).startswith('-') else str(path))


def refuse_inside(source: Path, target: Path) -> None:
    """Check that `target` lies outside the folder `source`, whose next reading would find it.

    Raises:
        InputError: it lies inside.
    """
    if source.is_dir() and target.resolve().is_relative_to(source.resolve()):
        raise InputError(
            f'{target}: lies inside {source}, whose next reading would find it too; name a folder '
            'elsewhere'
        )


def refuse_existing(path: Path) -> None:
    """Check that `path` does not exist, so that nothing is overwritten, and may be written.

    Raises:
        InputError: `path` exists, or its folder may not be written.
    """
    if path.is_symlink() and not path.exists():
        raise InputError(f'{path} is a link to nothing; name another output or remove it')
    if path.exists():
        raise InputError(f'{path} exists already; name another output or remove it')
    check_writable(path)
