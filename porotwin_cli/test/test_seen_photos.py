"""The facts in files of photographs."""

from collections.abc import Callable

import cv2
import numpy as np

from porotwin_cli.photographs.seen_photos import SeenPhotos
from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.photos import Photo

JPEG = cv2.imencode('.jpg', np.full((40, 60, 3), 90, np.uint8))[1].tobytes()


def photos(*contents: bytes | None) -> list[Photo]:
    """Return photographs a, b, c, ... with these files; None cannot be read."""

    def reader(content: bytes | None) -> Callable[[], bytes]:
        def read() -> bytes:
            if content is None:
                raise InputError('is damaged')
            return content

        return read

    return [
        Photo(float(number), 'state', 'abcdef'[number], reader(content))
        for number, content in enumerate(contents)
    ]


def test_size_end_and_digest_of_a_file_are_known() -> None:
    whole, cut, text = SeenPhotos().of(photos(JPEG, JPEG[:-20], b'no picture'))
    assert (whole.name, whole.size, whole.is_cut) == ('a', (60, 40), False)
    assert (cut.size, cut.is_cut) == ((60, 40), True)
    assert text.size is None
    assert len({whole.digest, cut.digest, text.digest}) == 3


def test_a_file_that_cannot_be_read_has_no_digest() -> None:
    (lost,) = SeenPhotos().of(photos(None))
    assert (lost.size, lost.digest) == (None, b'')


def test_a_noted_file_is_not_read_again() -> None:
    seen, (first, second) = SeenPhotos(), photos(None, JPEG)
    seen.note(first, JPEG)
    one, other = seen.of([first, second])
    assert one.digest == other.digest != b''
