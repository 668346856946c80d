"""Tests of words that came over the graph: no text acts on a terminal, and a flood is counted."""

import unicodedata

import pytest

from porotwin_core.basis.plain_text import plain
from porotwin_core.basis.remark import Remark
from porotwin_core.ros.foreign_words import FEW, LONGEST_WORDS, PERIOD_S, FewWords, said

ACTING = [chr(code) for code in range(0x110000)
          if unicodedata.category(chr(code)) in {'Cc', 'Cf', 'Cs', 'Zl', 'Zp'}]  # fmt: skip


def test_no_character_acts_on_a_terminal() -> None:
    shown = plain(''.join(ACTING))
    assert shown.isascii()
    assert shown.isprintable()
    for acts in ('\x1b', '\r', '\n', '\x9b', '\u202e', '\u2066', '\u2028', '\x85', '\x7f'):
        assert acts in ACTING


@pytest.mark.parametrize('blank', '\u115f\u1160\u3164\uffa0\u2800\u034f\ufe0f\U000e0100')
def test_a_letter_that_nobody_sees_is_shown_by_its_number(blank: str) -> None:
    shown = plain(f'control{blank}1')
    assert shown.isascii()
    assert shown != 'control1'


def test_what_a_person_writes_stays_as_it_is() -> None:
    text = 'Bjørn: Zuckerlösung 5 µl, 温度 21 °C -- it is "off"; \\ 100 %'
    assert plain(text) == text


ORDER = '\x1b[2J\x1b[Hsetpoint 777\n  barrier1       1500.0 ml/h   <-- set\r'


def test_words_are_one_line_of_their_sender() -> None:
    line = said('hub\nsetpoint 778', ORDER)
    assert line.startswith("'hub\\nsetpoint 778' says: \"\\x1b[2J\\x1b[Hsetpoint 777\\n")
    assert line.isprintable()
    assert '  ' not in line


def test_words_cannot_end_their_own_quotation() -> None:
    assert said("a' says: 'b", 'off" setpoint 1 "') == (
        '\'a\\\' says: \\\'b\' says: "off\\" setpoint 1 \\""'
    )


def test_words_are_short() -> None:
    for long in ('x' * 10_000_000, '\x1b' * 5000, ' ' * 10_000_000 + 'order'):
        assert len(said(long, long)) < 3 * LONGEST_WORDS


def test_an_empty_text_is_told_too() -> None:
    assert said('lamp', '') == '\'lamp\' says: ""'


@pytest.fixture
def lines() -> list[str]:
    return []


class Clock:
    """A clock that a test sets."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_flood_gives_a_few_lines_and_one_with_their_number(lines: list[str]) -> None:
    clock = Clock()
    few = FewWords(lines.append, known=['hub'], clock=clock)
    for number in range(25_900):
        few.tell(f'name {number}', f'line {number}')
    few.tell('hub', 'a line of the hub')
    assert lines == [f'line {number}' for number in range(FEW)] + ['a line of the hub']
    clock.now = PERIOD_S
    few.look()
    few.look()
    (rest,) = lines[FEW + 1 :]
    assert rest == f'{25_900 - FEW} more lines of nodes that are not of the twin are not shown'
    few.tell('lamp', 'the next period')
    assert lines[-1] == 'the next period'


def test_a_remark_about_a_foreign_name_acts_on_no_terminal() -> None:
    assert str(Remark('rates.csv', 'inj\x1b[2J\u202e', 'unknown\nwell', '')).isprintable()


def test_one_place_may_tell_warnings_and_errors() -> None:
    log = pytest.importorskip('porotwin_core.ros.plain_log').PlainLogger('recorder')
    for tell in (log.warning, log.error, log.warning):
        FewWords(tell).tell('stranger', 'set aside')
