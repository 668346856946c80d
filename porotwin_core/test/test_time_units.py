"""Tests of the units of times for people."""

import pytest

from porotwin_core.clock.time_units import DAYS, HOURS, MINUTES, time_unit


@pytest.mark.parametrize(
    ('hours', 'unit'), [(0.1, MINUTES), (10.0, MINUTES), (10.1, HOURS), (120, HOURS), (121, DAYS)]
)
def test_the_unit_follows_from_the_duration_of_the_experiment(hours, unit):
    assert time_unit(3600.0 * hours) is unit


def test_times_are_written_with_their_unit():
    assert MINUTES.text(4000.0) == '67 min'
    assert HOURS.text(40000.0) == '11.1 h'
    assert DAYS.number(864000.0) == '10.0'
    assert MINUTES.precise(90.0) == '1.5 min'
    assert HOURS.precise(98100.0) == '27.25 h'
