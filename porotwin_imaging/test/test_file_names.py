"""Names of files in messages, and their order."""

import os

import pytest

from porotwin_imaging.photograph.file_names import LONGEST_NAME, natural_order, one_line, printable


@pytest.mark.parametrize(
    ('name', 'shown'),
    [
        (b'IMG_1.jpg', 'IMG_1.jpg'),
        ('größe 1.jpg'.encode(), 'größe 1.jpg'),
        (b'\xff\x80.jpg', r'\xff\x80.jpg'),
        (b'a\nb\r\x1b[0m.jpg', r'a\nb\r\x1b[0m.jpg'),
    ],
)
def test_names_become_one_line_of_text(name: bytes, shown: str) -> None:
    assert printable(os.fsdecode(name)) == shown


def test_every_text_can_be_logged() -> None:
    text = ''.join(map(chr, [*range(0x300), *range(0xD7F0, 0xE010), 0x2028, 0x1F600]))
    one_line(text).encode('utf-8')
    assert len(one_line(text).splitlines()) == 1
    assert len(printable('x' * 300)) <= LONGEST_NAME


def test_numbers_in_names_count() -> None:
    names = ['IMG_10.jpg', 'IMG_9.jpg', 'IMG_09.jpg', '7.jpg', '\u0663.jpg', 'a.jpg']
    ordered = sorted(names, key=natural_order)
    assert ordered.index('IMG_9.jpg') < ordered.index('IMG_10.jpg')
    assert ordered[0] == '7.jpg'
