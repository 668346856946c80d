"""Rows of effects that are named once or twice."""

import pytest

from porotwin_diagnosis.report.named_rows import named_rows, verdict_words, with_occurrences

SUMMARY = {
    'effects': [
        {'name': 'rate', 'parameters': {'well': 'one'}},
        {'name': 'decay', 'parameters': {}},
        {'name': 'rate', 'parameters': {'well': 'other'}},
    ]
}


def test_a_name_that_comes_twice_gets_both_rows():
    rows = named_rows(SUMMARY, ['rate', 'decay', 'rate'])
    assert [row['parameters'].get('well') for row in rows] == ['one', None, 'other']
    assert list(with_occurrences('aba')) == [('a', 0), ('b', 0), ('a', 1)]


def test_a_name_without_a_row_is_an_error():
    with pytest.raises(KeyError, match='decay'):
        named_rows(SUMMARY, ['decay', 'decay'])


def test_a_verdict_names_all_effects_that_act_together():
    assert verdict_words({'verdict': 'clock', 'combination': ['clock', 'leak']}) == 'clock and leak'
    assert verdict_words({'verdict': 'unexplained', 'combination': []}) == 'unexplained'
