"""Exposure times: EXIF, else the protocol, else the file."""

import io
import os
from datetime import UTC, datetime

import numpy as np
import pytest
from PIL import Image

from porotwin_imaging.exposure import exposure_time, from_exif


def with_exif(**tags: str) -> bytes:
    image = Image.fromarray(np.full((20, 30, 3), 90, np.uint8))
    exif = Image.Exif()
    details = exif.get_ifd(0x8769)
    codes = {'original': 0x9003, 'subsecond': 0x9291, 'offset': 0x9011}
    for name, value in tags.items():
        details[codes[name]] = value
    file = io.BytesIO()
    image.save(file, 'JPEG', exif=exif)
    return file.getvalue()


MOMENT = datetime(2021, 9, 3, 14, 5, 6, tzinfo=UTC).timestamp()


def test_exif_with_subseconds_and_zone() -> None:
    data = with_exif(original='2021:09:03 16:05:06', subsecond='250', offset='+02:00')
    assert from_exif(data) == pytest.approx(MOMENT + 0.25, abs=1e-6)
    west = with_exif(original='2021:09:03 08:35:06', offset='-05:30')
    assert from_exif(west) == pytest.approx(MOMENT)


def test_exif_without_zone_is_local_time() -> None:
    data = with_exif(original='2021:09:03 14:05:06')
    assert from_exif(data) == datetime(2021, 9, 3, 14, 5, 6).timestamp()


@pytest.mark.parametrize('original', ['', '0000:00:00 00:00:00', 'yesterday'])
def test_a_clock_that_was_never_set_counts_as_none(original: str) -> None:
    assert from_exif(with_exif(original=original)) is None


def test_the_order_of_trust(tmp_path) -> None:
    path = tmp_path / 'a.jpg'
    path.write_bytes(with_exif())
    os.utime(path, (5000.5, 5000.5))
    assert exposure_time(path.read_bytes(), None, path) == 5000.5
    assert exposure_time(path.read_bytes(), 30.0, path) == 30.0
    dated = with_exif(original='2021:09:03 14:05:06', offset='+00:00')
    assert exposure_time(dated, 30.0, path) == MOMENT
