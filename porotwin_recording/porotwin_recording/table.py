"""The small CSV tables of an experiment folder: a header that must be exact, checked numbers."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path

from porotwin_core.errors import InputError


def read_table(
    path: Path, header: tuple[str, ...], purpose: str
) -> Iterator[tuple[str, list[str]]]:
    """Yield (file:line, words) of every filled line of the table `path` below its `header`.

    Raises:
        InputError: the file is missing (`purpose` says what it is for), not a table, or has
            another header or number of columns.
    """
    try:
        with path.open(encoding='utf-8-sig', newline='') as file:
            lines = csv.reader(file)
            found = tuple(word.strip() for word in next(lines, ()))
            if found != header:
                raise InputError(
                    f"{path}: first line is '{','.join(found)}'; write {','.join(header)}"
                )
            for line in lines:
                words = [word.strip() for word in line]
                if not any(words):
                    continue
                where = f'{path}:{lines.line_num}'
                if len(words) != len(header):
                    raise InputError(f'{where}: has {len(words)} values; needs {",".join(header)}')
                yield where, words
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; it holds {purpose}') from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{path}: not readable as CSV: {error}') from None


def write_table(path: Path, header: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> None:
    """Write `rows` below `header`."""
    with path.open('w', encoding='utf-8', newline='') as file:
        lines = csv.writer(file, lineterminator='\n')
        lines.writerow(header)
        lines.writerows(rows)


def number(text: str, what: str) -> float:
    """Return the finite number that `text` stands for.

    Raises:
        InputError: it stands for none; `what` says where.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{what} is '{text}'; write a finite number")
    return value


def number_text(value: float) -> str:
    """Return the shortest text that reads back as `value`."""
    number = float(value)  # a whole number may come as int, which has no is_integer in Python 3.11
    return str(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)
