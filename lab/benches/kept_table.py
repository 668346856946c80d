"""The tables of `bench` on disk, with machine, versions and date; each is compared with the last.

Times of two runs differ by the load of the machine. So a row counts by its ratio to a baseline of
the same run, or by its time relative to the other rows.
"""

import datetime
import json
import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

from porotwin_core.basis.errors import writing
from porotwin_core.basis.whole_file import write_whole

FOLDER = Path('runs', 'bench')
"""Where the tables lie, in the working folder."""

SLOWER = 1.2
"""Ratio to the last run above which a row is named."""

LIBRARIES = ('numpy', 'scipy', 'numba', 'opencv-python-headless', 'torch')
"""Libraries that take most of the time; their versions stand beside a table."""

Rows = Sequence[Mapping[str, Any]]


def keep_table(part: str, rows: Rows, folder: Path = FOLDER) -> list[str]:
    """Write the table of `part` into `folder`; return a line for each row that became slower.

    Raises:
        InputError: the folder cannot be made or written.
    """
    now = datetime.datetime.now().astimezone()
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    earlier = sorted(folder.glob(f'{part}-*.json'))
    table = {
        'part': part,
        'date': now.isoformat(timespec='seconds'),
        'machine': _machine(),
        'versions': {'python': platform.python_version()} | {n: version(n) for n in LIBRARIES},
        'rows': rows,
    }
    file = folder / f'{part}-{now:%Y%m%d-%H%M%S}.json'
    write_whole(file, json.dumps(table, indent=1))
    if not earlier:
        return [f'{file} holds the table; the next one is compared with it']
    try:
        last = json.loads(earlier[-1].read_bytes())
        found = slower_rows(rows, last['rows'])
    except (ValueError, LookupError, TypeError, AttributeError):
        return [f'{file} holds the table; {earlier[-1]} is damaged: delete it']
    other = (
        '' if last['machine'] == table['machine'] else f', on another machine: {last["machine"]}'
    )
    return [f'{file} holds the table; the last one is of {last["date"]}{other}', *found]


def slower_rows(rows: Rows, earlier: Rows) -> list[str]:
    """Return a line for each row whose time, in ratio, exceeds `SLOWER` times that of `earlier`."""
    before, after = _times(earlier), _times(rows)
    changes = {name: after[name] / before[name] for name in after if name in before}
    usual = 1.0 if _ratio_column(rows) else median(changes.values() or [1.0])
    return [
        f'slower than last time: {name}, {100.0 * (change / usual - 1.0):.0f} % in ratio'
        for name, change in changes.items()
        if change > SLOWER * usual
    ]


def _ratio_column(rows: Rows) -> str | None:
    """Return the column with ratios to a baseline of the same run."""
    return next((name for row in rows for name in row if name.startswith('ratio_to_')), None)


def _times(rows: Rows) -> dict[str, float]:
    """Return the ratio of each row, or its first time, by the words that name the row."""
    found = {}
    for row in rows:
        column = _ratio_column(rows) or next((name for name in row if name.endswith('_s')), '')
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
