"""The last lines of a demo with a hidden effect."""

import math

import pytest

from porotwin_cli.running.mended_loop import mending_lines


@pytest.mark.parametrize(
    ('found', 'minute', 'told'),
    [
        (['porosity:factor=0.902'], 40.0, 'found at minute 40, accepted and kept: the porosity'),
        ([], math.nan, 'no offer was accepted'),
        ([], 40.0, 'an effect was accepted at minute 40 and taken back'),
    ],
)
def test_the_demo_tells_what_was_hidden_found_and_gained(found, minute, told) -> None:
    figures = {
        'hidden_in_words': 'the porosity is 10 % lower than nominal',
        'found': found,
        'found_in_words': 'the porosity is 9.8 % lower than nominal',
        'verdict_minute': minute,
        'dose_ml_min': 271.0,
        'dose_ml_min_never_told': 270.6,
        'dose_ml_min_knew': 266.7,
        'forecast_error': {'as described': 0.058, 'mended': 0.0423, 'knew': 0.0424},
    }
    hidden, line, *missing, gained, dose = mending_lines(figures)
    assert dose.startswith('dose in the zone: 271 ml min with this twin, 271 with one that never')
    assert hidden.endswith('the porosity is 10 % lower than nominal')
    assert line.startswith(told)
    mended = '4.2 % mended, ' if found else ''
    assert f'5.8 % as described, {mended}4.2 % with the true effect' in gained
    assert [text.startswith('forecast.png is not drawn') for text in missing] == [True] * (
        not found
    )
