"""The growth of a node's memory."""

import pytest

from lab.faults.endurance import MOST_GROWTH, growth


def test_memory_counts_from_the_end_of_the_first_hour() -> None:
    readings = [(600.0 * n, 100e6 + (5e6 * n if n < 6 else 30e6)) for n in range(1, 25)]
    found = growth(readings)
    assert found.warm == found.end == 130e6
    assert found.share == 0.0


def test_a_leak_is_told_per_thousand_photographs() -> None:
    readings = [(600.0 * n, 100e6 + 1e6 * n) for n in range(1, 25)]
    found = growth(readings)
    assert found.share > MOST_GROWTH
    assert found.per_1000 == pytest.approx(50e6)  # 20 photographs in ten minutes
