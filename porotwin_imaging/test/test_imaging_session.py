"""The state of imaging beside a rig: baselines, the sequence, and refused photographs."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_imaging.live.imaging_session import ImagingSession


@pytest.fixture
def session(laboratory, calibration) -> ImagingSession:
    rig = laboratory.rig
    return ImagingSession(rig, rig.grid(90, 50), calibration=calibration)


def test_a_photograph_needs_a_baseline(session, laboratory, no_tracer) -> None:
    with pytest.raises(InputError, match='no baseline yet'):
        session.add_photo(0.0, laboratory.photograph(no_tracer))


def test_waiting_photographs_are_released_by_the_baseline(session, empty_photograph) -> None:
    assert session.waiting.add(1.0, b'one').startswith('no baseline yet')
    assert session.add_baseline(empty_photograph) == [(1.0, b'one')]


def test_a_refused_baseline_leaves_the_earlier_one_in_use(
    session, laboratory, empty_photograph, no_tracer
) -> None:
    session.add_baseline(empty_photograph)
    before = session.baseline
    grey = cv2.imencode('.jpg', np.full((2 * 640, 2 * 890, 3), 90, np.uint8))[1].tobytes()
    black = laboratory.photograph(no_tracer, gain=0.0005, noise=0.0)
    for refused in (grey, black):
        with pytest.raises(InputError):
            session.add_baseline(refused)
        assert session.baseline is before
        assert session.baseline_photos == [empty_photograph]


def test_baselines_before_the_first_state_are_averaged(
    session, laboratory, empty_photograph, no_tracer
) -> None:
    second = laboratory.photograph(no_tracer, seed=2)
    session.add_baseline(empty_photograph)
    session.add_baseline(second)
    assert session.baseline_photos == [empty_photograph, second]


def test_a_further_baseline_with_tracer_is_refused_before_the_first_state(
    session, laboratory, empty_photograph, true_map
) -> None:
    session.add_baseline(empty_photograph)
    before = session.baseline
    with pytest.raises(InputError, match='baseline 2: differs from baseline 1 on'):
        session.add_baseline(laboratory.photograph(true_map, seed=4))
    assert session.baseline is before
    assert session.baseline_photos == [empty_photograph]


def test_a_baseline_that_is_left_out_changes_nothing_whenever_it_is_offered(
    session, laboratory, empty_photograph, no_tracer, true_map
) -> None:
    other = laboratory.photograph(no_tracer, seed=2)
    session.leave_out_baseline(other)
    assert session.add_baseline(other) == []
    assert session.baseline is None
    session.add_baseline(empty_photograph)
    session.add_photo(30.0, laboratory.photograph(true_map))
    assert session.add_baseline(other) == []
    assert session.baseline_photos == [empty_photograph]


def test_a_baseline_after_a_state_starts_a_new_experiment(
    session, laboratory, empty_photograph, no_tracer, true_map
) -> None:
    session.add_baseline(empty_photograph)
    first = session.add_photo(30.0, laboratory.photograph(true_map))
    second = session.add_photo(60.0, laboratory.photograph(true_map, seed=3))
    assert [state.number for state in (first, second)] == [0, 1]
    assert [state.placement.action for state in (first, second)] == ['start', 'next']
    with pytest.raises(InputError, match='as a new baseline it shows tracer on'):
        session.add_baseline(laboratory.photograph(true_map, seed=4))
    new = laboratory.photograph(no_tracer, seed=5)
    session.add_baseline(new)
    assert session.baseline_photos == [new]
    before = session.baseline
    for offered_again in (empty_photograph, new):  # by a restarted camera
        assert session.add_baseline(offered_again) == []
    assert session.baseline is before
    third = session.add_photo(90.0, laboratory.photograph(true_map, seed=6))
    assert (third.number, third.placement.action) == (0, 'start')


def test_a_camera_that_froze_in_a_pause_stays_frozen(
    session, laboratory, empty_photograph, true_map
) -> None:
    session.add_baseline(empty_photograph)
    for time, seed in ((30.0, 3), (60.0, 4)):
        last = laboratory.photograph(true_map, seed=seed)
        session.add_photo(time, last)
    pixels = cv2.imdecode(np.frombuffer(last, np.uint8), cv2.IMREAD_COLOR)
    again = cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, 99])[1].tobytes()
    with pytest.raises(InputError, match='the camera is frozen'):
        session.add_photo(6000.0, again)
    fresh = session.add_photo(6030.0, laboratory.photograph(true_map, seed=5))
    assert fresh.placement.action == 'start'


def test_a_photograph_that_cannot_be_read_is_no_state(
    session, laboratory, empty_photograph, true_map
) -> None:
    session.add_baseline(empty_photograph)
    good = laboratory.photograph(true_map)
    for data, complaint in ((b'broken', 'not a JPEG'), (good, None), (good, 'duplicate')):
        if complaint is None:
            assert session.add_photo(30.0, data).number == 0
        else:
            with pytest.raises(InputError, match=complaint):
                session.add_photo(30.0, data)


def test_a_rig_without_a_camera_is_refused_at_once(laboratory) -> None:
    rig: Rig = laboratory.rig.model_copy(update={'camera': None})
    with pytest.raises(InputError, match='has no camera'):
        ImagingSession(rig, rig.grid(90, 50))
