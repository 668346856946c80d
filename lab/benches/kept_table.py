"""The tables of `bench` on disk, with machine, versions and date; each is compared with the last.

Times of two runs differ by the load of the machine. So a row counts by its ratio to a baseline of
the same run, or to the time of a fixed piece of work, the yardstick.
"""

import datetime
import json
import math
import platform
import timeit
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from porotwin_core.basis.errors import writing
from porotwin_core.basis.whole_file import write_whole

FOLDER = Path('runs', 'bench')
"""Where the tables lie, in the working folder."""

SLOWER = 1.2
"""Ratio to the last run above which a row is named."""

LIBRARIES = ('numpy', 'scipy', 'numba', 'opencv-python-headless', 'torch')
"""Libraries that take most of the time; their versions stand beside a table."""

YARDSTICK_NUMBERS = 2_000_000
"""Numbers that the yardstick sorts: a quarter of a second."""

Rows = Sequence[Mapping[str, Any]]
Table = Mapping[str, Any]


def last_duration(part: str, folder: Path = FOLDER) -> float | None:
    """Return how long [s] the last measurement of `part` took; None: not known."""
    last = _last(part, folder)
    return None if last is None else last[1].get('seconds')


def make_folder(folder: Path = FOLDER) -> None:
    """Make the folder of the tables, before anything is measured.

    Raises:
        InputError: it cannot be made.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)


def keep_table(part: str, rows: Rows, seconds: float, folder: Path = FOLDER) -> list[str]:
    """Write the table of `part` into `folder`; return a line for each row that became slower.

    `seconds` is the time that its measurement took.

    Raises:
        InputError: the folder cannot be made or written.
    """
    now = datetime.datetime.now().astimezone()
    make_folder(folder)
    last = _last(part, folder)
    table = {
        'part': part,
        'date': now.isoformat(timespec='seconds'),
        'seconds': round(seconds, 1),
        'yardstick_s': round(yardstick(), 4),
        'machine': _machine(),
        'versions': {'python': platform.python_version()} | {n: version(n) for n in LIBRARIES},
        'rows': rows,
    }
    file = folder / f'{part}-{now:%Y%m%d-%H%M%S}.json'
    write_whole(file, json.dumps(table, indent=1))
    about = f'{file} holds the table, of {table["machine"]}'
    if last is None:
        return [f'{about}; the next one is compared with it']
    name, before = last
    try:
        return [f'{about}; {_compared(table, before)}', *_slower(table, before)]
    except (KeyError, TypeError, AttributeError, ArithmeticError):
        return [f'{about}; {name} is damaged or of an older version: delete it']


def _compared(table: Table, before: Table) -> str:
    """Return what `table` is compared with, and what differs besides the rows."""
    older, newer = before['versions'], table['versions']
    other = [f'of {before["machine"]}'] if before['machine'] != table['machine'] else []
    other += [
        f'{name} {older[name]} then, {newer[name]} now'
        for name in newer
        if older.get(name, newer[name]) != newer[name]
    ]
    return ', '.join([f'compared with {before["date"]}', *other])


def _slower(table: Table, before: Table) -> list[str]:
    """Return the lines of `slower_rows` for two tables."""
    usual = table['yardstick_s'] / before['yardstick_s']
    return slower_rows(table['rows'], before['rows'], usual)


def slower_rows(rows: Rows, earlier: Rows, usual: float) -> list[str]:
    """Return a line for each row whose time, in ratio, exceeds `SLOWER` times that of `earlier`.

    `usual` is the time of the yardstick divided by its earlier one. It does not matter where the
    rows have a baseline of their own.
    """
    before, after = _times(earlier), _times(rows)
    if _ratio_column(rows):
        usual = 1.0
    changes = {name: after[name] / before[name] / usual for name in after if name in before}
    return [
        f'slower than last time: {name}, {100.0 * (change - 1.0):.0f} % in ratio'
        for name, change in changes.items()
        if change > SLOWER
    ]


def yardstick() -> float:
    """Return the time [s] of a fixed piece of work, the median of five."""
    numbers = np.random.default_rng(0).random(YARDSTICK_NUMBERS)
    return median(timeit.repeat(lambda: np.sort(numbers), number=1, repeat=5))


def _last(part: str, folder: Path) -> tuple[Path, dict[str, Any]] | None:
    """Return the last table of `part` and its file; it is empty if the file is damaged."""
    files = sorted(folder.glob(f'{part}-*.json'))
    if not files:
        return None
    try:
        read = json.loads(files[-1].read_bytes())
    except ValueError:
        read = {}
    return files[-1], read if isinstance(read, dict) else {}


def _ratio_column(rows: Rows) -> str | None:
    """Return the column with ratios to a baseline of the same run."""
    return next((name for row in rows for name in row if name.startswith('ratio_to_')), None)


def _times(rows: Rows) -> dict[str, float]:
    """Return the ratio of each row, or its first time, by the words that name the row."""
    found = {}
    for row in rows:
        column = _ratio_column(rows) or next(
            (name for name in row if name.endswith(('_s', '[s]'))), ''
        )
        value = row.get(column)
        if isinstance(value, int | float) and math.isfinite(value) and value > 0.0:
            found[', '.join(word for word in row.values() if isinstance(word, str) and word)] = (
                float(value)
            )
    return found


def _machine() -> str:
    """Return the processor of this machine, as far as the system tells."""
    cpus = Path('/proc/cpuinfo')
    lines = cpus.read_text().splitlines() if cpus.is_file() else []
    models = [line.partition(': ')[2] for line in lines if line.startswith('model name')]
    name = models[0] if models else platform.processor() or platform.machine()
    return f'{len(models) or "?"} x {name}, {platform.system()} {platform.release()}'
