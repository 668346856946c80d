"""Files of photographs that are no pictures, are cut, differ in size or repeat another are told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks.checks.photograph_files import CHECK
from porotwin_checks.known import Known, PhotoFile
from porotwin_core.basis.remark import Remark
from porotwin_core.rig import Camera

CAMERA = Camera(corners_px=((0, 0), (0, 39), (59, 39), (59, 0)))
RIG = box_rig(left=(0.1, 0.2)).model_copy(update={'camera': CAMERA})
SIZE = (60, 40)


def found(*photos: PhotoFile) -> list[Remark]:
    return list(CHECK.find(Known(rig=RIG, seen_photos=photos)))


def photos(contents: str) -> list[PhotoFile]:
    """Return whole photographs a, b, c, ... with these files; - could not be read."""
    return [
        PhotoFile('abcdefghijkl'[number], SIZE, False, b'' if one == '-' else one.encode())
        for number, one in enumerate(contents)
    ]


def test_whole_files_of_one_size_are_not_odd() -> None:
    assert found(*photos('123')) == []
    assert found(*photos('1'), *photos('1')) == [], '`photograph_list` tells a name in two lines'
    assert found(*photos('121')) == [], 'equal files apart: a dry rig may look the same again'


@pytest.mark.parametrize(
    ('photo', 'code'),
    [
        (PhotoFile('b', None, True, b'2'), 'unreadable_photos'),
        (PhotoFile('b', SIZE, True, b'2'), 'cut_photos'),
        (PhotoFile('b', (59, 40), False, b'2'), 'several_sizes'),
    ],
)
def test_a_file_that_is_not_like_the_others_is_told(photo: PhotoFile, code: str) -> None:
    (remark,) = found(*photos('1'), photo)
    assert remark.code == code


def test_rows_of_equal_files_are_named_with_their_ends() -> None:
    (remark,) = found(*photos('122232--44'))
    assert remark.code == 'same_files'
    assert remark.facts['runs'] == [
        {'first': 'b', 'last': 'd', 'photographs': 3},
        {'first': 'i', 'last': 'j', 'photographs': 2},
    ]
    assert 'b to d (3 photographs), i to j (2 photographs)' in str(remark)


def test_a_file_in_two_lines_counts_once_among_equal_files() -> None:
    twice = [PhotoFile(name, SIZE, False, b'1') for name in ('./b', 'b', 'c')]
    (remark,) = found(*twice)
    assert [run['photographs'] for run in remark.facts['runs']] == [2]


@pytest.mark.parametrize('size', [None, SIZE])
def test_a_lost_baseline_is_impossible_unless_there_are_maps(size: tuple[int, int] | None) -> None:
    files = [PhotoFile('b', size, True, b'2')]
    listed = [SimpleNamespace(time=0.0, name='b', role='baseline')]
    known = Known(rig=RIG, seen_photos=files, photos=listed)
    with_maps = replace(known, times=[0.0], maps=np.zeros((1, 2, 2)))
    assert [one.refused for one in CHECK.find(known)] == [True]
    assert [one.refused for one in CHECK.find(with_maps)] == [False]
    assert [one.refused for one in CHECK.find(replace(known, photos=()))] == [False]


def test_photographs_without_a_place_of_the_rig_are_refused() -> None:
    known = Known(rig=box_rig(left=(0.1, 0.2)), seen_photos=photos('1'))
    (remark,) = CHECK.find(known)
    assert remark.refused
