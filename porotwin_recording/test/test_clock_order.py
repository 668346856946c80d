"""Tests of the order of photographs beside their local times."""

from datetime import UTC, datetime, timedelta

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.clock_order import check_order, counters

MIDNIGHT = datetime(2026, 10, 25, tzinfo=UTC)
SET_BACK = (150, 170, 130, 150, 170, 190)
"""Minutes after midnight that a camera shows at the end of summer time."""


def judged(minutes: tuple[int, ...], numbers: list[int] | None) -> str:
    """Return the remark about times in minutes after midnight."""
    times = [MIDNIGHT + timedelta(minutes=each) for each in minutes]
    return check_order(times, [f'{time:%H:%M}' for time in times], 'p.csv: datetime', numbers)


def test_a_clock_that_was_set_back_is_refused_by_the_number_and_by_the_row() -> None:
    fault = r"p\.csv: datetime:4: '02:10' of photograph 3 is earlier than '02:50' of photograph 2"
    with pytest.raises(InputError, match=f'{fault}.*--time-zone.*offsets'):
        judged(SET_BACK, [1, 2, 3, 4, 5, 6])
    with pytest.raises(InputError, match=r":4: '02:10' of row 4 is earlier .* sort the rows"):
        judged(SET_BACK, None)
    # rows sorted by local time
    with pytest.raises(InputError, match=r'of photograph 3 is earlier than .* of photograph 2'):
        judged(tuple(sorted(SET_BACK)), [3, 1, 4, 2, 5, 6])
    with pytest.raises(InputError, match='of photograph 2'):
        judged((170, 130), [1, 2])


@pytest.mark.parametrize(
    ('minutes', 'numbers'),
    [
        ((10, 20, 30), [1, 2, 3]),
        ((30, 20, 10), [3, 2, 1]),
        ((20, 10, 30), [2, 1, 3]),
        ((10, 20, 30, 40), [9998, 9999, 1, 2]),
        ((10, 20), [5, 9000]),
        ((10, 10, 20), None),
        ((), []),
    ],
)
def test_numbers_that_rise_with_time_need_no_remark(
    minutes: tuple[int, ...], numbers: list[int] | None
) -> None:
    assert judged(minutes, numbers) == ''


def test_lists_in_another_order_are_sorted_with_a_remark() -> None:
    for numbers in (None, [1, 2, 3]):
        assert 'newest first' in judged((30, 20, 10), numbers)
    for minutes in ((10, 40, 20, 50, 30), (100, 200, 10)):
        assert 'sorted by time' in judged(minutes, None)


def test_names_have_counters_if_all_are_of_one_camera() -> None:
    assert counters(['DSC_0009', 'DSC_0010']) == [9, 10]
    assert counters(['1', '2']) == [1, 2]
    for stems in (['IMG_023000', 'IMG_025000'], ['a1', 'b2'], ['a1', 'a01'], ['a', 'b']):
        assert counters(stems) is None
