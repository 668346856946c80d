"""Tests of tables of other programs: numbers with commas, and titles that repeat."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.foreign_table import Decimal, read_foreign_table


def numbers(folder: Path, *words: str, decimal: Decimal | None = None) -> list[float]:
    """Return the numbers of a column that is written beside dates."""
    path = folder / 'p.csv'
    path.write_text('\n'.join(['when;rate', *(f'31.05.2024;{word}' for word in words)]))
    return read_foreign_table(path, decimal).numbers('rate')


@pytest.mark.parametrize(
    ('words', 'decimal', 'read'),
    [
        (('0,500', '-0,250'), None, [0.5, -0.25]),
        (('0,500', '1,500'), None, [0.5, 1.5]),
        (('1,500', '7'), 'point', [1500.0, 7.0]),
        (('1,234,567', '.5'), None, [1234567.0, 0.5]),
        (('1.234.567', '0,5'), None, [1234567.0, 0.5]),
        (("1'500.5", '2e-3'), None, [1500.5, 0.002]),
        (('5.4D-06', '2.5d3', '0.1'), None, [5.4e-6, 2500.0, 0.1]),
        (('1.500', '0,5'), None, [1500.0, 0.5]),
        (('1.500', '0.250'), None, [1.5, 0.25]),
        (('- 2 500,25', '2\u00a0500'), None, [-2500.25, 2500.0]),
    ],
)
def test_thousands_and_decimal_commas_are_read(
    tmp_path: Path, words: tuple[str, ...], decimal: Decimal | None, read: list[float]
) -> None:
    assert numbers(tmp_path, *words, decimal=decimal) == read


@pytest.mark.parametrize(
    ('words', 'decimal', 'fault'),
    [
        (('0,500', '0.235'), None, r"decimal commas, such as '0\.235' and '0,500'"),
        (('1,500', '7'), None, r"is '1,500' 1\.500 or 1500\? write all numbers"),
        (('7', '0,500'), 'point', r"p\.csv:3: rate is '0,500', no number with a decimal point"),
        (('1,50', '7'), 'point', 'no number with a decimal point; write it'),
        (('0.500', '7'), 'comma', "'0.500', no number with a decimal comma"),
        (('1 5', '7'), None, 'write a number'),
        (
            ('1.500', '7'),
            None,
            r"is '1\.500' 1\.500 or 1500\? write all numbers",
        ),
    ],
)
def test_a_comma_that_fits_neither_is_refused(
    tmp_path: Path, words: tuple[str, ...], decimal: Decimal | None, fault: str
) -> None:
    with pytest.raises(InputError, match=fault):
        numbers(tmp_path, *words, decimal=decimal)


def test_points_beside_commas_between_columns_are_decimal(tmp_path: Path) -> None:
    path = tmp_path / 'p.csv'
    path.write_text('well,rate\nin,1.500\n')
    assert read_foreign_table(path).numbers('rate') == [1.5]


def test_two_columns_for_one_quantity_are_refused(tmp_path: Path) -> None:
    path = tmp_path / 'p.csv'
    path.write_text('rate [ml/min],well,rate [ml/min],\n8,in,80,\n')
    with pytest.raises(InputError, match=r"columns 1 and 3 are both titled 'rate \[ml/min\]'"):
        read_foreign_table(path)
    path.write_text('start [utc],start [local],,\n1,2,3,4\n')
    with pytest.raises(InputError, match=r"which column is meant, 'start \[utc\]' or 'start"):
        read_foreign_table(path).needed('start')


@pytest.mark.parametrize(
    ('text', 'encoding'),
    [('well\trate\nin\t2,5\n', 'utf-16'), ('sep=;\r\nwell;rate\r\nin;2,5\r\n', 'utf-8')],
)
def test_unicode_text_and_separator_hints_of_excel_are_read(
    tmp_path: Path, text: str, encoding: str
) -> None:
    path = tmp_path / 'p.csv'
    path.write_bytes(text.encode(encoding))
    table = read_foreign_table(path)
    assert table.columns['well'] == ['in']
    assert table.numbers('rate') == [2.5]


def test_a_word_is_named_by_its_line_behind_a_hint_and_empty_lines(tmp_path: Path) -> None:
    path = tmp_path / 'p.csv'
    path.write_text('sep=;\nwell;rate\nin;1,5\n\n;\nin;fast\n')
    with pytest.raises(InputError, match=r"p\.csv:6: rate is 'fast'"):
        read_foreign_table(path).numbers('rate')
