"""The memory of a camera across restarts."""

import os
from pathlib import Path

import pytest

from porotwin_core.basis.parent import PARENT
from porotwin_imaging.photograph.sent_photos import (
    LINES_FILE,
    MOST_BASELINES,
    SentPhoto,
    SentPhotos,
    digest_of,
    folder_of_launch,
    forget_ended_launches,
)

PHOTOS = [
    SentPhoto(os.fsdecode(name), digest_of(name), (3, 4, 5), 1.8e9 + 30.0 * n, 0.0, 'state')
    for n, name in enumerate((b'1.jpg', b'\xff.jpg', b'3.jpg'))
]


def remember(folder: Path) -> SentPhotos:
    sent = SentPhotos(folder)
    for photo in PHOTOS:
        sent.add(photo)
    sent.keep()
    return sent


def test_a_restart_knows_the_photographs(tmp_path) -> None:
    first = remember(tmp_path / 'new')
    assert not first.began_before
    again = SentPhotos(tmp_path / 'new')
    assert again.began_before
    assert list(again) == PHOTOS
    assert again.last == PHOTOS[-1]
    assert again.claim(digest_of(b'1.jpg'), 'copy.jpg') == '1.jpg'
    assert again.claim(digest_of(b'4.jpg'), '4.jpg') is None
    assert again.claim(digest_of(b'4.jpg'), '5.jpg') == '4.jpg'
    assert again.problem == ''


def test_photographs_that_were_not_kept_are_forgotten(tmp_path) -> None:
    SentPhotos(tmp_path).add(PHOTOS[0])
    again = SentPhotos(tmp_path)
    assert again.began_before
    assert not again.any_sent


HUGE = b'{"name":"x","digest":"00","mark":[1e300,1,1],"stamp":1,"correction":0,"role":""}'


@pytest.mark.parametrize(
    'damage', [b'{"name": "x"', b'\xff\x00\xfe', b'[]', b'null', b'{}' * 9, HUGE]
)
def test_a_damaged_line_costs_that_line(tmp_path, damage: bytes) -> None:
    remember(tmp_path)
    path = tmp_path / LINES_FILE
    lines = path.read_bytes().splitlines()
    path.write_bytes(b'\n'.join([damage, *lines[:-1], damage]))
    again = SentPhotos(tmp_path)
    assert list(again) == PHOTOS[:2]
    assert 'a line cannot be read' in again.problem
    again.add(PHOTOS[2])
    again.keep()
    assert list(SentPhotos(tmp_path)) == PHOTOS


def test_without_a_folder_the_camera_works_on(tmp_path) -> None:
    (tmp_path / 'file').write_text('in the way')
    sent = remember(tmp_path / 'file' / 'progress')
    assert 'cannot remember what it sent' in sent.problem
    assert sent.last == PHOTOS[-1]
    sent.keep_baseline(1.0, b'x')
    assert sent.baselines() == []
    assert remember(None).last == PHOTOS[-1]


def test_the_last_baselines_are_kept(tmp_path) -> None:
    sent = SentPhotos(tmp_path)
    for number in range(10):
        sent.keep_baseline(1.8e9 + number, b'%d' % number)
    found = SentPhotos(tmp_path).baselines()
    assert found == [(1.8e9 + n, b'%d' % n) for n in range(10 - MOST_BASELINES, 10)]


def test_one_launch_has_one_folder_for_each_source(monkeypatch) -> None:
    monkeypatch.setenv(PARENT, str(os.getpid()))  # the parent of a detached run is process 1
    one = folder_of_launch('folder:/a')
    assert folder_of_launch('folder:/a') == one
    assert folder_of_launch('folder:/b') != one
    monkeypatch.setenv(PARENT, '1')
    assert folder_of_launch('folder:/a') != one


def test_the_folders_of_ended_launches_are_deleted(tmp_path) -> None:
    mine = tmp_path / folder_of_launch('folder:/a').name
    ended = tmp_path / 'camera-999999999-77-abcdef01'
    other = tmp_path / 'camera-roll'
    for folder in (mine, ended, other):
        folder.mkdir()
    forget_ended_launches(mine)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([mine.name, other.name])
