"""Photographs that wait for the baseline."""

from porotwin_imaging.live.waiting_photos import WaitingPhotos


def test_the_newest_photographs_are_kept_and_each_warning_comes_once() -> None:
    waiting = WaitingPhotos(room=3)
    warnings = [waiting.add(float(time), b'%d' % time) for time in range(6)]
    assert [bool(line) for line in warnings] == [True, False, False, True, False, False]
    assert warnings[0].startswith('no baseline yet, photographs wait for one: take a photograph')
    assert 'the oldest that wait for one are left out' in warnings[3]
    assert waiting.release() == [(3.0, b'3'), (4.0, b'4'), (5.0, b'5')]
    assert waiting.release() == []
    assert waiting.add(6.0, b'6') == warnings[0]
