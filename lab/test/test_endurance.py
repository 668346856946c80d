"""The growth of a node's memory."""

import pytest

from lab.faults.endurance import MOST_GROWTH, growth


def test_memory_counts_from_the_end_of_the_first_hour() -> None:
    readings = [(600.0 * n, 100e6 + (5e6 * n if n < 6 else 30e6)) for n in range(1, 25)]
    found = growth(readings)
    assert found.warm == found.end == 130e6
    assert found.share == 0.0


def test_a_leak_shows_in_the_second_half() -> None:
    readings = [(600.0 * n, 100e6 + 1e6 * n) for n in range(1, 25)]
    found = growth(readings)
    assert found.late_share == pytest.approx(12e6 / 112e6)
    assert found.late_share > MOST_GROWTH


def test_buffers_that_fill_in_the_first_half_are_no_leak() -> None:
    readings = [(600.0 * n, 100e6 + 1e6 * min(n, 12)) for n in range(1, 25)]
    found = growth(readings)
    assert found.share > MOST_GROWTH
    assert found.late_share == 0.0
