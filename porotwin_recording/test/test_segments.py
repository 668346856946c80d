"""Where an experiment in a bag begins anew."""

import pytest

from porotwin_recording.experiment.segments import LocatedPhoto, Location, PhotoKey, Segment
from porotwin_recording.mcap.serialization import SECOND

HERE = Location('photographs', 0, 0)
DAY = 86400 * SECOND


@pytest.mark.parametrize(('days', 'starts', 'begins'), [(8, True, True), (8, False, False),
                                                        (1, True, False)])  # fmt: skip
def test_a_start_after_more_than_a_week_begins_another_experiment_with_the_same_baseline(
    days: int, starts: bool, begins: bool
) -> None:
    baseline = PhotoKey('baseline', 0, 1)
    first = Segment(start=0, maps={0: HERE}, photos={baseline: LocatedPhoto(HERE, '.jpg')})
    found = first.restarted(days * DAY, starts=starts)
    assert bool(found) is begins
    assert bool(first.interruptions) is not begins
    assert baseline in first.photos
    assert all(one.start == days * DAY and baseline in one.photos for one in found)
