"""JPEG files that are damaged are refused, and those that only look odd are read."""

import io
import re

import cv2
import numpy as np
import pytest
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_imaging.photograph.jpeg_file import (
    JPEG_END,
    jpeg_fault,
    jpeg_pixels,
    jpeg_size,
)


def picture() -> Image.Image:
    rough = np.random.default_rng(2).integers(60, 180, (120, 200, 3), dtype=np.uint8)
    return Image.fromarray(cv2.GaussianBlur(rough, (0, 0), 2))


def encoded(**options: object) -> bytes:
    file = io.BytesIO()
    picture().save(file, 'JPEG', quality=90, **options)
    return file.getvalue()


ODD = {
    'progressive': {'progressive': True},
    'restart markers': {'restart_marker_blocks': 3},
    'no subsampling': {'subsampling': 0},
    'own tables': {'optimize': True},
}


@pytest.mark.parametrize('options', ODD.values(), ids=ODD)
def test_every_kind_of_jpeg_is_whole_and_has_the_pixels_of_another_decoder(options: dict) -> None:
    data = encoded(**options)
    assert jpeg_fault(data) == ''
    assert jpeg_size(data) == (200, 120)
    for reduction, flag in ((1, cv2.IMREAD_COLOR), (4, cv2.IMREAD_REDUCED_COLOR_4)):
        other = cv2.imdecode(np.frombuffer(data, np.uint8), flag)
        assert np.array_equal(jpeg_pixels(data, reduction), other)


def scan_starts(data: bytes) -> list[int]:
    """Return where the segments after each scan but the last begin."""
    scans = [found.start() for found in re.finditer(b'\xff\xda', data)]
    next_marker = re.compile(rb'\xff[\xc4\xda]')
    return [next_marker.search(data, scan + 2).start() for scan in scans[:-1]]  # type: ignore[union-attr]


def test_a_progressive_jpeg_without_its_last_scans_is_incomplete() -> None:
    data = encoded(progressive=True)
    places = scan_starts(data)
    assert len(places) > 5
    for place in places:
        assert 'is incomplete: scans of' in jpeg_fault(data[:place] + JPEG_END)


@pytest.mark.parametrize('options', ODD.values(), ids=ODD)
def test_a_cut_within_a_scan_is_refused_without_a_line_of_the_decoder(options, capfd) -> None:
    data = encoded(**options)
    for share in (0.5, 0.8, 0.95, 0.98):
        cut = data[: int(share * len(data))] + JPEG_END
        with pytest.raises(InputError, match='is broken') as error:
            jpeg_pixels(cut, 1)
        assert '\n' not in str(error.value)
    assert capfd.readouterr() == ('', '')


def test_damaged_segments_are_told_from_a_missing_end() -> None:
    data = encoded()
    assert jpeg_fault(data[:-2]) == 'is truncated: its end is missing'
    frame = data.index(b'\xff\xc0')
    longer = data[: frame + 2] + b'\xff\xff' + data[frame + 4 :]
    assert jpeg_fault(longer) == 'is broken: segments are damaged'
