"""Tests of the expiry of setpoints."""

from porotwin_hub.operator.setpoint_expiry import ExpiryWatch, validity


def test_a_setpoint_is_valid_for_three_photo_intervals() -> None:
    assert validity(30.0) == 90.0


def test_an_expiry_is_reported_once() -> None:
    watch = ExpiryWatch()
    assert watch.expired(1e9) is None
    watch.start(7, now=100.0, validity=90.0)
    assert watch.expired(189.0) is None
    assert watch.expired(191.0) == 7
    assert watch.expired(192.0) is None


def test_a_new_setpoint_ends_the_watch_of_the_old_one() -> None:
    watch = ExpiryWatch()
    watch.start(1, now=0.0, validity=90.0)
    watch.start(2, now=30.0, validity=90.0)
    assert watch.expired(100.0) is None
    assert watch.expired(121.0) == 2
