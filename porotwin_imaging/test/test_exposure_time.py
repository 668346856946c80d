"""Exposure times from EXIF."""

import contextlib
import io
import random
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_imaging.photograph.exposure_time import exif_time, exif_words


def with_exif(**tags: str) -> bytes:
    image = Image.fromarray(np.full((20, 30, 3), 90, np.uint8))
    exif = Image.Exif()
    details = exif.get_ifd(0x8769)
    codes = {
        'original': 0x9003,
        'subsecond': 0x9291,
        'offset': 0x9011,
        'offset_digitized': 0x9012,
        'offset_changed': 0x9010,
    }
    for name, value in tags.items():
        if name == 'changed':
            exif[0x0132] = value
        else:
            details[codes[name]] = value
    file = io.BytesIO()
    image.save(file, 'JPEG', exif=exif)
    return file.getvalue()


MOMENT = datetime(2021, 9, 3, 14, 5, 6, tzinfo=UTC).timestamp()


def test_exif_with_subseconds_and_zone() -> None:
    data = with_exif(original='2021:09:03 16:05:06', subsecond='250', offset='+02:00')
    assert exif_time(data) == pytest.approx(MOMENT + 0.25, abs=1e-6)
    west = with_exif(original='2021:09:03 08:35:06', offset='-05:30')
    assert exif_time(west) == pytest.approx(MOMENT)
    without_colon = with_exif(original='2021:09:03 08:35:06', offset='-0530')
    assert exif_time(without_colon) == pytest.approx(MOMENT)


@pytest.mark.parametrize(
    ('tags', 'zone'),
    [
        ({'offset_changed': '+02:00'}, '+02:00'),
        ({'offset_digitized': '+02:00'}, '+02:00'),
        ({'offset': '+02:00', 'offset_changed': '+05:00'}, '+02:00'),
        ({'offset': '   :  ', 'offset_changed': '+02:00'}, '+02:00'),
        ({'changed': '2021:09:03 16:05:06', 'offset_changed': '+02:00'}, '+02:00'),
        ({'changed': '2021:09:05 09:00:00', 'offset_changed': '+09:00'}, ''),
    ],
    ids=['changed', 'digitized', 'own first', 'empty', 'unchanged', 'edited later'],
)
def test_other_tags_of_the_zone_count_unless_a_file_was_edited_later(tmp_path, tags, zone) -> None:
    path = tmp_path / 'a.jpg'
    path.write_bytes(with_exif(original='2021:09:03 16:05:06', **tags))
    assert exif_words(path) == f'2021-09-03 16:05:06{zone}'


def test_exif_without_zone_is_local_time() -> None:
    data = with_exif(original='2021:09:03 14:05:06')
    assert exif_time(data) == datetime(2021, 9, 3, 14, 5, 6).timestamp()


@pytest.mark.parametrize('original', ['', '0000:00:00 00:00:00', 'yesterday'])
def test_a_clock_that_was_never_set_gives_no_time(original: str) -> None:
    assert exif_time(with_exif(original=original)) is None


@pytest.mark.parametrize(
    'tags',
    [
        {'original': '2021:09:03 14:05:06', 'offset': '+99:00'},
        {'original': '0001:01:01 00:00:00'},
    ],
    ids=['offset', 'year 1'],
)
def test_an_impossible_time_is_refused(tags: dict[str, str]) -> None:
    with pytest.raises(InputError, match="is impossible; set the camera's clock"):
        exif_time(with_exif(**tags))


@pytest.mark.filterwarnings('ignore::UserWarning:PIL')
def test_damaged_metadata_gives_no_time() -> None:
    data = with_exif(original='2021:09:03 14:05:06', subsecond='9999', offset='+00:00')
    data = data.replace(b'9999', b'\xb2' * 4)  # digits, but not of a number
    assert exif_time(data) == MOMENT
    generator = random.Random(7)
    for _ in range(300):
        spoiled = bytearray(data)
        for place in generator.sample(range(2, 200), 4):
            spoiled[place] = generator.randrange(256)
        with contextlib.suppress(InputError):
            exif_time(bytes(spoiled))


@pytest.mark.parametrize(
    ('tags', 'words'),
    [
        ({'original': '2021:09:03 14:05:06'}, '2021-09-03 14:05:06'),
        (
            {'original': '2021:09:03 14:05:06', 'subsecond': '25', 'offset': '+02:00'},
            '2021-09-03 14:05:06.25+02:00',
        ),
        (
            {'original': '2021:09:03 14:05:06', 'offset': '+0530'},
            '2021-09-03 14:05:06+05:30',
        ),
        ({'original': '2021:09:03 14:05:06', 'offset': 'local'}, '2021-09-03 14:05:06'),
        ({'original': '0000:00:00 00:00:00'}, ''),
        ({}, ''),
    ],
)
def test_the_time_in_a_file_is_given_as_words(
    tmp_path: Path, tags: dict[str, str], words: str
) -> None:
    path = tmp_path / 'IMG_0001.JPG'
    path.write_bytes(with_exif(**tags))
    assert exif_words(path) == words
    assert exif_words(tmp_path / 'no such file') == ''
