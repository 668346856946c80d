"""Tests of the photographs that wait to be read."""

from porotwin_imaging.live.photo_queue import PhotoQueue, QueuedPhoto


def test_photographs_keep_their_order() -> None:
    queue = PhotoQueue(room=4)
    photos = [QueuedPhoto('baseline', 0.0, b'b'), QueuedPhoto('state', 30.0, b's')]
    assert [queue.put(photo) for photo in photos] == [None, None]
    assert [queue.get(), queue.get()] == photos


def test_the_newest_photographs_and_all_baselines_stay_where_none_is_read() -> None:
    queue = PhotoQueue(room=4)
    lines = [queue.put(QueuedPhoto('baseline', 0.0, b'b'))]
    lines += [queue.put(QueuedPhoto('state', 30.0 * number, b's')) for number in range(6)]
    assert [bool(line) for line in lines] == [False] * 5 + [True, False]
    assert lines[5] is not None
    assert lines[5].facts == {'count': 2, 'first': '0:00:00', 'last': '0:00:30'}
    assert [queue.get().time for _ in range(5)] == [0.0, 60.0, 90.0, 120.0, 150.0]
