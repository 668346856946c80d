"""A frozen camera is told, whatever its files say; still maps and replays are not."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.live.frozen_camera import FrozenCamera
from porotwin_imaging.live.imaging_session import ImagingSession
from porotwin_imaging.photograph.photo_file import decode

FROZEN = 'the camera is frozen'


@pytest.fixture
def session(laboratory, calibration, empty_photograph) -> ImagingSession:
    rig = laboratory.rig
    session = ImagingSession(rig, rig.grid(90, 50), calibration=calibration)
    session.add_baseline(empty_photograph)
    return session


def stamped(jpeg: bytes, words: str) -> bytes:
    """Return the photograph with a comment behind its first marker, as a new EXIF time would be."""
    comment = words.encode()
    return jpeg[:2] + b'\xff\xfe' + (len(comment) + 2).to_bytes(2, 'big') + comment + jpeg[2:]


def compressed_again(jpeg: bytes, quality: int) -> bytes:
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    return cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def test_the_second_frozen_photograph_is_no_state_whatever_its_metadata(
    session, laboratory, true_map
) -> None:
    picture = laboratory.photograph(true_map)
    session.add_photo(30.0, picture)
    for number in (2, 3):
        with pytest.raises(InputError, match=FROZEN):
            session.add_photo(30.0 * number, stamped(picture, f'photograph {number}'))
    thawed = session.add_photo(120.0, laboratory.photograph(true_map, seed=4))
    assert (thawed.number, thawed.placement.action) == (1, 'next')


def test_a_clock_drawn_into_a_frozen_picture_does_not_make_it_new(
    session, laboratory, true_map
) -> None:
    session.add_photo(30.0, laboratory.photograph(true_map))
    pixels = cv2.imdecode(np.frombuffer(laboratory.photograph(true_map), np.uint8), 1)
    rows, columns = pixels.shape[:2]
    drawn = pixels.copy()
    cv2.putText(drawn, '12:30:00', (columns // 2, rows // 2), 0, 1.0, (255, 255, 255), 2)
    with pytest.raises(InputError, match=FROZEN):
        session.add_photo(60.0, cv2.imencode('.png', drawn)[1].tobytes())


@pytest.mark.parametrize('quality', [95, 98])
def test_a_picture_that_is_compressed_again_is_an_old_one(
    session, laboratory, true_map, quality
) -> None:
    for number in (1, 2):
        picture = laboratory.photograph(true_map, seed=number)
        session.add_photo(30.0 * number, picture)
    with pytest.raises(InputError, match=FROZEN):
        session.add_photo(90.0, compressed_again(picture, quality))


def test_a_picture_that_is_always_compressed_again_is_told_at_its_second_photograph(
    session, laboratory, true_map
) -> None:
    picture = laboratory.photograph(true_map)
    session.add_photo(30.0, picture)
    session.add_photo(60.0, compressed_again(picture, 60))
    with pytest.raises(InputError, match=FROZEN):
        session.add_photo(90.0, stamped(compressed_again(picture, 60), 'later'))


def test_two_pictures_in_turn_are_told(session, laboratory, true_map) -> None:
    pictures = [laboratory.photograph(true_map, seed=number) for number in (1, 2)]
    for number, picture in enumerate(pictures):
        session.add_photo(30.0 * number, picture)
    for number, picture in enumerate(2 * pictures, start=2):
        with pytest.raises(InputError, match=FROZEN):
            session.add_photo(30.0 * number, compressed_again(picture, 95))


def test_still_maps_are_new_photographs_by_their_noise(session, laboratory, no_tracer) -> None:
    states = [
        session.add_photo(30.0 * number, laboratory.photograph(no_tracer, seed=number, gain=gain))
        for number, gain in enumerate((1.0, 1.0, 0.98, 1.0, 0.97), start=1)
    ]
    assert [state.number for state in states] == [0, 1, 2, 3, 4]


def test_a_camera_that_stops_shaking_is_not_frozen(laboratory, true_map) -> None:
    frozen = FrozenCamera()
    for number, shift in enumerate((0.0, 3.0, -2.0, 2.5, 0.0, 0.0, 0.0)):
        data = laboratory.photograph(true_map, seed=number, shift=(shift, 0.5 * shift))
        frozen.check(decode(data))
    with pytest.raises(InputError, match=FROZEN):
        frozen.check(decode(data))


def test_a_recording_that_is_played_again_is_read_again(laboratory, calibration, true_map) -> None:
    rig = laboratory.rig
    session = ImagingSession(rig, rig.grid(90, 50), calibration=calibration, replayed=True)
    session.add_baseline(laboratory.photograph(0.0 * true_map, seed=1))
    picture = laboratory.photograph(true_map)
    later = laboratory.photograph(true_map, seed=5)
    for _ in range(2):
        assert session.add_photo(30.0, stamped(picture, 'a')).placement.action == 'start'
        assert session.add_photo(60.0, later).placement.action == 'next'
