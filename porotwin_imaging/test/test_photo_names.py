"""Messages begin with the name of the photograph that is wrong."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photograph.photo_names import baseline_names, named


def test_baselines_without_names_have_numbers_and_a_single_one_has_none() -> None:
    assert baseline_names([], 1) == ['']
    assert baseline_names([], 2) == ['baseline 1', 'baseline 2']
    assert baseline_names(['a.jpg', 'b.jpg'], 2) == ['a.jpg', 'b.jpg']
    with pytest.raises(InputError, match='2 baselines have 1 names'):
        baseline_names(['a.jpg'], 2)


def test_a_name_begins_the_message() -> None:
    with pytest.raises(InputError, match=r'^a\.jpg: black$'), named('a.jpg'):
        raise InputError('black')
    with pytest.raises(InputError, match=r'^black$'), named(''):
        raise InputError('black')


def test_a_bad_baseline_is_named(laboratory, no_tracer, empty_photograph) -> None:
    small = cv2.imencode('.jpg', np.full((100, 200, 3), 90, np.uint8))[1].tobytes()
    black = laboratory.photograph(no_tracer, gain=0.0005, noise=0.0)
    other = cv2.imencode('.jpg', np.full((2 * 640, 2 * 890, 3), 90, np.uint8))[1].tobytes()
    rig, grid = laboratory.rig, laboratory.rig.grid(90, 50)
    for bad in (b'', small, black, empty_photograph[:5000], other):
        with pytest.raises(InputError, match=r'^a\.jpg: '):
            make_baseline(rig, grid, [bad], names=['a.jpg'])
        with pytest.raises(InputError, match=r'^b\.jpg: '):
            make_baseline(rig, grid, [empty_photograph, bad], names=['a.jpg', 'b.jpg'])
