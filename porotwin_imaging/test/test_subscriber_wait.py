"""Photographs wait until all who want them are there."""

from porotwin_imaging.audience import PATIENCE, Audience


def test_a_recorder_alone_gets_no_photograph_that_the_imaging_would_miss() -> None:
    now = [0.0]
    audience = Audience(2, clock=lambda: now[0])
    assert not audience.is_complete(listening=0, known=0)
    assert not audience.is_complete(listening=1, known=1)
    now[0] = 3.0
    assert not audience.is_complete(listening=1, known=2)
    assert audience.is_complete(listening=2, known=2)


def test_a_viewer_that_cannot_listen_does_not_cut_the_others_off() -> None:
    now = [0.0]
    audience = Audience(1, clock=lambda: now[0])
    assert not audience.is_complete(listening=1, known=2)
    now[0] = PATIENCE
    assert audience.is_complete(listening=1, known=2)


def test_whoever_never_comes_does_not_keep_the_others_waiting() -> None:
    now = [0.0]
    audience = Audience(2, clock=lambda: now[0])
    assert not audience.is_complete(listening=1, known=1)
    now[0] = PATIENCE
    assert audience.is_complete(listening=1, known=1)
