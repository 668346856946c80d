"""Photographs at another pace than the twin was told are noticed."""

import pytest

from porotwin_hub.loop.photo_pace import odd_pace


@pytest.mark.parametrize(
    ('times', 'odd'),
    [
        ([0.0, 300.0, 600.0], False),  # too few
        ([0.0, 300.0, 600.0, 900.0], True),
        ([0.0, 10.0, 20.0, 30.0], True),
        ([0.0, 30.0, 60.0, 150.0, 180.0], False),  # two were lost
        ([0.0, 28.0, 57.0, 90.0], False),
    ],
)
def test_another_pace_is_told(times: list[float], odd: bool) -> None:
    assert bool(odd_pace(times, 30.0)) is odd


def test_the_remark_names_both_paces() -> None:
    remark = odd_pace([0.0, 300.0, 600.0, 900.0], 30.0)
    assert remark is not None
    assert remark.facts == {'usual_s': 300.0, 'expected_s': 30.0}
