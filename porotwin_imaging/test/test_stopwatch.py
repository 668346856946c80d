"""Times of named stages."""

from porotwin_imaging.numerics.stopwatch import Stopwatch


def test_repeated_stages_add_up() -> None:
    watch = Stopwatch()
    with watch.stage('one'):
        pass
    first = watch.timings['one']
    with watch.stage('one'):
        pass
    assert watch.timings['one'] > first >= 0.0
    assert list(watch.timings) == ['one']
