"""CSV tables of other programs: separators, decimal commas and encodings as Excel writes them."""

import codecs
import csv
import math
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular

Decimal = Literal['point', 'comma']

SEPARATORS = ';\t,'
"""Separators of columns, the surest first: a comma may be a decimal comma."""

WRITE_NUMBER = 'write a number, its unit in the title'
"""Remedy for a word that is no number."""

_NUMBER = re.compile(r'[+-]?[\d.,\s\u00a0\u202f\']*\d[\d.,]*(?:[eE][+-]?\d+)?')
_THOUSANDS = re.compile(r'[+-]?[1-9]\d{0,2}[.,]\d{3}')
"""A number whose mark may separate thousands; behind a leading zero it cannot."""

_SEPARATORS = re.compile(r"[.,\s']")
_WHOLE = re.compile(r"[+-]?\s*(?:\d+|[1-9]\d{0,2}([.,\s'])\d{3}(?:\1\d{3})*)")
"""A whole number; separators stand before three digits each, and all are the same."""


@dataclass(frozen=True)
class ForeignTable:
    """The words of a table.

    Attributes:
        path: the file.
        columns: words of every column by its title, which is in small letters.
        decimal: how its numbers are written.
        spelling: how the file spells a title, by its title in small letters.
        lines: number of the line of each row in the file.
    """

    path: Path
    columns: dict[str, list[str]]
    decimal: Decimal
    spelling: dict[str, str] = field(default_factory=dict)
    lines: tuple[int, ...] = ()

    @property
    def length(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), []))

    def spelt(self, title: str) -> str:
        """Return a title as the file spells it."""
        return self.spelling.get(title, title)

    @property
    def titles(self) -> str:
        """All titles, as the file spells them."""
        return ', '.join(map(self.spelt, self.columns))

    def find(self, *names: str) -> str | None:
        """Return the title of the first column that is one of `names`, without its unit.

        Raises:
            InputError: several columns have that name and differ in their units.
        """
        for name in names:
            found = [title for title in self.columns if bare_title(title) == name]
            if found:
                return self.only(found)
        return None

    def only(self, titles: Sequence[str]) -> str:
        """Return the one title in `titles`.

        Raises:
            InputError: there are several; nothing says which column is meant.
        """
        if len(titles) > 1:
            raise InputError(
                f"{self.path}: which column is meant, '{self.spelt(titles[0])}' or "
                f"'{self.spelt(titles[1])}'? delete the "
                'other one, or put another word before its title, such as note'
            )
        return titles[0]

    def needed(self, *names: str) -> str:
        """Return the title as `find`.

        Raises:
            InputError: there is no such column, or there are several.
        """
        found = self.find(*names)
        if found is None:
            raise InputError(
                f"{self.path}: has no column '{names[0]}'; rename the one that holds it. Its "
                f'columns are {self.titles}'
            )
        return found

    def numbers(
        self, title: str, needed: Sequence[bool] = (), *, remedy: str = WRITE_NUMBER
    ) -> list[float]:
        """Return the numbers of a column.

        Args:
            title: of the column.
            needed: whether a row must have a number; elsewhere an empty word is 0. Empty: all must.
            remedy: for a missing number.

        Raises:
            InputError: a word is no number; the message names the line.
        """
        words = self.columns[title]
        rows = zip(words, needed or [True] * len(words), self.lines, strict=True)
        return [
            self._number(word, f'{self.path}:{line}: {self.spelt(title)}', '' if word else remedy)
            if word or must
            else 0.0
            for word, must, line in rows
        ]

    def _number(self, word: str, where: str, remedy: str) -> float:
        value = number_in(word, self.decimal)
        if math.isfinite(value):
            return value
        other: Decimal = 'point' if self.decimal == 'comma' else 'comma'
        otherwise = number_in(word, other)
        if math.isfinite(otherwise):
            raise InputError(
                f"{where} is '{word}', no number with a decimal {self.decimal}; "
                f'write it with one, or give --decimal {other} for {otherwise:g}'
            )
        raise InputError(f"{where} is '{word}'; {remedy or WRITE_NUMBER}")


def bare_title(title: str) -> str:
    """Return a title without its unit: `rate [ml/min]` is `rate`."""
    return re.split(r'[\[(]', title)[0].strip().replace(' ', '_')


def number_in(word: str, decimal: Decimal) -> float:
    """Return the number in a word; NaN if there is none.

    Thousands may be separated, as in 1,500. In 0,500 and 1,50 nothing separates thousands.
    """
    whole, mark, rest = word.strip().partition(',' if decimal == 'comma' else '.')
    if _SEPARATORS.search(whole):
        if not _WHOLE.fullmatch(whole):
            return math.nan
        whole = _SEPARATORS.sub('', whole)
    text = f'{whole}.{rest}' if mark else whole
    try:
        return float(text) if text.isascii() and '_' not in text else math.nan
    except ValueError:
        return math.nan


def read_foreign_table(path: Path, decimal: Decimal | None = None) -> ForeignTable:
    """Return the table in the file `path`.

    Args:
        path: a CSV file; columns are separated by semicolons, tabs or commas.
        decimal: how numbers are written; None: as the numbers themselves show.

    Raises:
        InputError: the file is missing or no table, or its numbers can be read in two ways.
    """
    text = _text(path)
    first, _, rest = text.partition('\n')
    hinted = first.strip().lower().startswith('sep=')  # a hint for Excel
    if hinted:
        text, first = rest, rest.split('\n', 1)[0]
    separator = next((mark for mark in SEPARATORS if mark in first), ',')
    reader = csv.reader(text.splitlines(), delimiter=separator)
    try:
        found = [(reader.line_num + hinted, line) for line in reader if any(line)]
    except csv.Error as error:
        raise InputError(f'{path}: not readable as CSV: {error}') from None
    numbers, lines = [number for number, _ in found], [line for _, line in found]
    if len(lines) < 2:
        raise InputError(f'{path}: has no rows below its titles')
    spelt = [' '.join(title.split()) for title in lines[0]]
    titles = [title.lower() for title in spelt]
    for number, line in found[1:]:
        if len(line) != len(titles):
            raise InputError(f'{path}:{number}: has {len(line)} values, the titles {len(titles)}')
    _check_repeated(path, spelt)
    words = [[line[at].strip() for line in lines[1:]] for at in range(len(titles))]
    chosen = decimal or _decimal(path, (word for column in words for word in column), separator)
    spelling = dict(zip(titles, spelt, strict=True))
    columns = dict(zip(titles, words, strict=True))
    return ForeignTable(path, columns, chosen, spelling, tuple(numbers[1:]))


def _check_repeated(path: Path, titles: Sequence[str]) -> None:
    """Refuse two columns of one title: nothing says which is meant. Empty titles do not count."""
    small = [title.lower() for title in titles]
    for second, title in enumerate(titles):
        first = small.index(title.lower())
        if title and first < second:
            raise InputError(
                f"{path}: the columns {first + 1} and {second + 1} are both titled '{title}'; "
                'delete one of them, or put another word before its title, such as note'
            )


def _text(path: Path) -> str:
    try:
        data = read_regular(path)
    except FileNotFoundError:
        raise InputError(f'{path}: no such file') from None
    except OSError as error:
        raise InputError(f'{path}: cannot be read ({error.strerror})') from None
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):  # Excel's "Unicode text"
        with suppress(UnicodeDecodeError):
            return data.decode('utf-16')
    for encoding in ('utf-8-sig', 'cp1252'):  # Excel writes the second unless asked otherwise
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise InputError(f'{path}: not a text in UTF-8; save it as CSV UTF-8')


def _decimal(path: Path, words: Iterable[str], separator: str) -> Decimal:
    """Return how the numbers among `words` are written; commas between columns need points.

    Raises:
        InputError: they can be read in two ways, or contradict each other.
    """
    marks: dict[str, str] = {}
    doubtful = ''
    for word in words:
        if not _NUMBER.fullmatch(word) or not {',', '.'} & set(word):
            continue
        last = word[max(word.rfind(','), word.rfind('.'))]
        if word.count(last) > 1:
            if _WHOLE.fullmatch(word):  # 1,234,567; a date such as 31.05.2024 is no number
                marks.setdefault({',': '.', '.': ','}[last], word)
        elif _THOUSANDS.fullmatch(word) and not (last == '.' and separator == ','):
            doubtful = doubtful or word
        else:
            marks.setdefault(last, word)
    if len(marks) > 1:
        raise InputError(
            f'{path}: some numbers have decimal points and some decimal commas, such as '
            f"'{marks['.']}' and '{marks[',']}'; write them alike, or give --decimal"
        )
    if doubtful and not marks:
        small, large = doubtful.replace(',', '.'), re.sub('[.,]', '', doubtful)
        answers = ('comma', 'point') if ',' in doubtful else ('point', 'comma')
        raise InputError(
            f"{path}: is '{doubtful}' {small} or {large}? give --decimal {answers[0]} or "
            f'--decimal {answers[1]}'
        )
    return 'comma' if ',' in marks else 'point'
