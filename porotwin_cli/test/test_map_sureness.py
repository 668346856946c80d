"""How sure maps are, in words."""

import numpy as np
import pytest

from porotwin_cli.photographs.map_sureness import (
    doubt_entry,
    plume_doubt,
    sureness_words,
    typical_doubt,
)


def test_the_doubt_is_that_of_the_plume() -> None:
    values = np.array([[0.0, 0.5, np.nan]])
    deviation, systematic = np.array([[0.9, 0.05, np.nan]]), np.array([[0.9, 0.03, np.nan]])
    assert plume_doubt(values, deviation, systematic) == pytest.approx((0.04, 0.03))
    assert np.isnan(plume_doubt(0.0 * values, deviation, systematic)).all()


def test_guessed_factors_are_counted() -> None:
    doubt, guessed = sureness_words([(0.04, 0.03), (np.nan, np.nan)], (0.01, 0.2, 0.19))
    assert '0.040 random, 0.030 systematic' in doubt
    assert '2 of 3;' in guessed
    assert sureness_words([(np.nan, np.nan)], ()) == []


def test_a_json_answer_holds_the_typical_doubt_and_no_nan() -> None:
    doubts = [(0.04, 0.03), (np.nan, np.nan), (0.02, 0.05)]
    assert doubt_entry(typical_doubt(doubts)) == {
        'random_deviation': 0.03,
        'systematic_deviation': 0.04,
    }
    assert set(doubt_entry(doubts[1]).values()) == {None}
