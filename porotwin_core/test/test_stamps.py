"""Stamps in words: dates since 1970, else a duration."""

import pytest

from porotwin_core.stamps import time_in_words


@pytest.mark.parametrize(
    ('stamp', 'words'),
    [
        (1.8e9 + 90.4, '2027-01-15 08:01:30 UTC'),
        (3690.0, '1:01:30'),
        (float('nan'), 'nan s'),
        (1e30, '1e+30 s'),
    ],
)
def test_a_stamp_is_a_date_or_a_duration(stamp: float, words: str) -> None:
    assert time_in_words(stamp) == words
