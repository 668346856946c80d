"""CSV tables of other programs: separators, decimal commas and encodings as Excel writes them.

The heads may stand below comments and above a line of units, in any language of
`words_of_languages.py`.
"""

import codecs
import csv
import math
import re
import unicodedata
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from porotwin_core.basis.csv_table import FORTRAN
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.text_with_unit import plain_number
from porotwin_recording.importers.foreign_units import is_unit
from porotwin_recording.importers.open_question import QuestionError
from porotwin_recording.importers.words_of_languages import (
    NAMES,
    plain,
    quantities,
    with_plain_signs,
)

Decimal = Literal['point', 'comma']

SEPARATORS = ';\t,|'
"""Separators of columns, the surest first: a comma may be a decimal comma."""

_COMMENT = ('#', '%', '//')
"""Begin of a comment; numpy and MATLAB write one before their titles too."""

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

    def find(self, *wanted: str) -> str | None:
        """Return the title of the first column of one of the `wanted` quantities.

        Raises:
            InputError: several columns have that name and differ in their units.
        """
        for name in (name for quantity in wanted for name in NAMES[quantity]):
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

    def needed(self, *wanted: str) -> str:
        """Return the title as `find`.

        Raises:
            InputError: there is no such column, or there are several.
        """
        found = self.find(*wanted)
        if found is None:
            raise InputError(
                f"{self.path}: has no column '{wanted[0]}'; rename the one that holds it. Its "
                f'columns are {self.titles}'
            )
        return found

    def is_number(self, title: str) -> bool:
        """Return whether the first word of a column is a number."""
        first = next(iter(self.columns[title]), '')
        return math.isfinite(number_in(first, self.decimal))

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
            raise QuestionError(
                f"{where} is '{word}', no number with a decimal {self.decimal}",
                [{'decimal': other}],
                f'write it with a decimal {self.decimal}',
            )
        raise InputError(f"{where} is '{word}'; {remedy or WRITE_NUMBER}")


def bare_title(title: str) -> str:
    """Return a title without its unit: `rate [ml/min]` is `rate`."""
    return plain(re.split(r'[\[(]', title)[0]).strip('_:.')


def number_in(word: str, decimal: Decimal) -> float:
    """Return the number in a word; NaN if there is none.

    Thousands may be separated, as in 1,500. In 0,500 and 1,50 nothing separates thousands.
    """
    usual = with_plain_signs(unicodedata.normalize('NFKC', word)).strip()  # digits of full width
    whole, mark, rest = usual.partition(',' if decimal == 'comma' else '.')
    if _SEPARATORS.search(whole):
        if not _WHOLE.fullmatch(whole):
            return math.nan
        whole = _SEPARATORS.sub('', whole)
    return plain_number(FORTRAN.sub('e', f'{whole}.{rest}' if mark else whole))


def read_foreign_table(path: Path, decimal: Decimal | None = None) -> ForeignTable:
    """Return the table in the file `path`.

    Args:
        path: a CSV file; columns are separated by semicolons, tabs or commas.
        decimal: how numbers are written; None: as the numbers themselves show.

    Raises:
        InputError: the file is missing or no table, or its numbers can be read in two ways.
    """
    rows = _rows(path, _text(path))
    head, separator = rows.head, rows.separator
    if not rows.below:
        raise InputError(f'{path}: has no rows below its titles')
    spelt = [' '.join(title.split()) for title in head]
    below = list(rows.below)
    if _is_of_units(below[0][1]) and len(below) > 1:
        spelt = [
            f'{title} [{unit.strip("[]() ")}]' if unit.strip('-[]() ') else title
            for title, unit in zip(spelt, below.pop(0)[1], strict=False)
        ]
    titles = [title.lower() for title in spelt]
    for number, line in below:
        if len(line) != len(titles):
            raise InputError(f'{path}:{number}: has {len(line)} values, the titles {len(titles)}')
    _check_repeated(path, spelt)
    words = [[_bare_word(line[at]) for _, line in below] for at in range(len(titles))]
    chosen = decimal or _decimal(path, (word for column in words for word in column), separator)
    spelling = dict(zip(titles, spelt, strict=True))
    columns = dict(zip(titles, words, strict=True))
    return ForeignTable(path, columns, chosen, spelling, tuple(number for number, _ in below))


@dataclass(frozen=True)
class _Rows:
    """The head of a table, the numbered rows below it, and the separator."""

    head: list[str]
    below: list[tuple[int, list[str]]]
    separator: str


def _rows(path: Path, text: str) -> _Rows:
    """Return the rows of a table, by the separator and the line that name most columns.

    Lines above the head are comments, and so are those that begin as one.
    """
    lines = text.splitlines()
    hinted = lines[:1] and lines[0].strip().lower().startswith('sep=')  # a hint for Excel
    lines = ['', *lines[1:]] if hinted else lines
    first = next((line for line in lines if line.strip()), '')
    marks = [mark for mark in SEPARATORS if mark in first] or [',']
    found = [_below_head(path, lines, mark) for mark in dict.fromkeys([*marks, *SEPARATORS])]
    return max(found, key=lambda rows: _named(rows.head))


def _below_head(path: Path, lines: Sequence[str], separator: str) -> _Rows:
    reader = csv.reader(lines, delimiter=separator)
    try:
        rows = [(reader.line_num, line) for line in reader if any(map(str.strip, line))]
    except csv.Error as error:
        raise InputError(f'{path}: not readable as CSV: {error}') from None
    if not rows:
        return _Rows([], [], separator)
    named = [_named(line) for _, line in rows]
    at = named.index(max(named)) if max(named) else 0
    while not max(named) and at < len(rows) - 1 and _is_comment(rows[at][1]):
        at += 1
    head = rows[at][1]
    head = [head[0].strip().lstrip('#%/ '), *head[1:]] if _is_comment(head) else head
    below = [(number, line) for number, line in rows[at + 1 :] if not _is_comment(line)]
    if head and not head[-1].strip() and all(not line[-1].strip() for _, line in below):
        head = head[:-1]  # a separator ends every line
    return _Rows(head, [(number, _of_length(line, len(head))) for number, line in below], separator)


def _bare_word(word: str) -> str:
    """Return a word without the formula by which programs keep Excel from changing it: ="word"."""
    bare = word.strip()
    return bare[2:-1] if bare.startswith('="') and bare.endswith('"') else bare


def _of_length(line: list[str], length: int) -> list[str]:
    """Return a line without empty words beyond `length`."""
    return line if any(word.strip() for word in line[length:]) else line[:length]


def _is_comment(line: Sequence[str]) -> bool:
    return line[0].strip().startswith(_COMMENT)


def _named(line: Sequence[str]) -> int:
    """Return how many words of a line are heads of columns."""
    bare = (bare_title(word.strip().lstrip('#%/ ')) for word in line)
    return sum(any(quantities(word)) for word in bare)


def _is_of_units(line: Sequence[str]) -> bool:
    """Return whether a line below the titles holds their units."""
    words = [word.strip('-[]() ') for word in line]
    return any(words) and all(not word or is_unit(word) for word in words)


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
            return with_plain_signs(data.decode('utf-16'))
    if b'\0' in data[: len('ab')]:  # the same without its mark
        with suppress(UnicodeDecodeError):
            return with_plain_signs(data.decode('utf-16-be' if data[0] == 0 else 'utf-16-le'))
    for encoding in ('utf-8-sig', 'cp1252'):  # Excel writes the second unless asked otherwise
        try:
            return with_plain_signs(data.decode(encoding))
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
        raise QuestionError(
            f'{path}: some numbers have decimal points and some decimal commas, such as '
            f"'{marks['.']}' and '{marks[',']}'",
            [{'decimal': 'point'}, {'decimal': 'comma'}],
            'write them alike',
        )
    if doubtful and not marks:
        small, large = doubtful.replace(',', '.'), re.sub('[.,]', '', doubtful)
        answers: tuple[Decimal, Decimal] = (
            ('comma', 'point') if ',' in doubtful else ('point', 'comma')
        )
        raise QuestionError(
            f"{path}: is '{doubtful}' {small} or {large}?",
            [{'decimal': answer} for answer in answers],
            'write all numbers without separators of thousands',
        )
    return 'comma' if ',' in marks else 'point'
