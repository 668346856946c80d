"""CSV tables of an experiment folder: an exact header and finite numbers."""

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_text
from porotwin_core.basis.text_with_unit import in_other_unit, plain_number

EXACT_INTEGERS = 1e15
"""Integers below this are written in full; float64 holds all of them exactly."""

THOUSANDS = re.compile(r'-?\d{1,3}(,\d{3})+')
"""A number with commas between its thousands, or with a decimal comma."""

FORTRAN = re.compile(r'(?<=[\d.])[dD](?=[-+]?\d+$)')
"""The letter of Fortran before the power of ten, as in 5.4D-06."""

CLOCK = re.compile(r'\d:\d|\d{4}-\d\d|\d\d?[./]\d\d?[./]\d{4}')
"""A part of a clock time or of a date."""

LONGEST_QUOTE = 80
"""Most characters of a wrong line that a message repeats."""


def read_table(
    path: Path, header: tuple[str, ...], purpose: str
) -> Iterator[tuple[str, list[str]]]:
    """Yield (location, words) for every line below the header; empty lines are skipped.

    The location is `file:line`, for messages.

    Args:
        path: the file, UTF-8 with or without a byte order mark.
        header: required words of the first line.
        purpose: the content of the table, for the message about a missing file.

    Raises:
        InputError: the file is missing or not a table, or its header or a number of columns is
            wrong.
    """
    try:
        with open_text(path, 'utf-8-sig') as file:
            lines = csv.reader(file)
            found = tuple(word.strip() for word in next(lines, ()))
            if found != header:
                first = ' '.join(','.join(found).split())[:LONGEST_QUOTE]
                hint = _separator_hint(','.join(found)) or _unit_hint(found, header)
                raise InputError(f"{path}: first line is '{first}'; write {','.join(header)}{hint}")
            for line in lines:
                words = [word.strip() for word in line]
                if not any(words):
                    continue
                where = f'{path}:{lines.line_num}'
                if any(word != ' '.join(word.splitlines()) for word in words):
                    raise InputError(f'{where}: a value goes over two lines; close its quotation')
                if len(words) != len(header):
                    comma = '; write decimal points, not commas' if len(words) > len(header) else ''
                    raise InputError(
                        f'{where}: has {len(words)} values; needs {",".join(header)}{comma}'
                    )
                yield where, words
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; it holds {purpose}') from None
    except UnicodeDecodeError:
        raise InputError(f'{path}: not a text in UTF-8; save it as CSV UTF-8') from None
    except (OSError, csv.Error) as error:
        reason = ' '.join(str(error).split())
        raise InputError(f'{path}: not readable as CSV: {reason}') from None


def _unit_hint(found: tuple[str, ...], header: tuple[str, ...]) -> str:
    """Return the end of the message about columns in other units; '' if there are none."""
    units = filter(None, (in_other_unit(word, header) for word in found))
    return ''.join(f'; {unit.split("; ")[1]}' for unit in units)


def _separator_hint(first: str) -> str:
    """Return the end of the message about a wrong `first` line."""
    for mark, name in ((';', 'semicolons'), ('\t', 'tabs')):
        if mark in first:
            return f'; it uses {name}: separate the columns by commas, with decimal points'
    return ''


def write_table(path: Path, header: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> None:
    """Write `rows` below `header`, in UTF-8 with Unix line ends."""
    with path.open('w', encoding='utf-8', newline='') as file:
        lines = csv.writer(file, lineterminator='\n')
        lines.writerow(header)
        lines.writerows(rows)


def parse_number(text: str, label: str) -> float:
    """Return the finite number in `text`.

    Raises:
        InputError: `text` is no finite number; `label` opens the message.
    """
    value = plain_number(text)
    if not math.isfinite(value):
        raise InputError(f"{label} is '{text}'; {_number_remedy(text)}")
    return value


def _number_remedy(text: str) -> str:
    """Return how to write what `text` probably means."""
    if THOUSANDS.fullmatch(text.strip()):
        plain, point = text.replace(',', ''), text.replace(',', '.')
        return f'write {plain}' + (f' or {point}' if text.count(',') == 1 else '')
    if FORTRAN.search(text):
        return f'write {FORTRAN.sub("e", text)}'
    if CLOCK.search(text):
        return 'write seconds from the start of the experiment; ./porotwin import reads clock times'
    return 'write a finite number' + (' with a decimal point' if ',' in text else '')


def number_text(value: float) -> str:
    """Return the shortest text that reads back as `value`; integers have no decimal point."""
    number = float(value)  # int has no is_integer in Python 3.11
    exact = number.is_integer() and abs(number) < EXACT_INTEGERS
    return str(int(number)) if exact else repr(number)
