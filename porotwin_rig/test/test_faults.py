"""Photographs that go wrong on purpose."""

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_rig.faults import FAULTS, parse_faults

_PICTURE = np.linspace(90, 150, 40 * 60 * 3).reshape(40, 60, 3).astype(np.uint8)
WHOLE = cv2.imencode('.jpg', _PICTURE)[1].tobytes()


def test_every_fault_changes_the_bytes() -> None:
    for name, spoil in FAULTS.items():
        assert spoil(WHOLE) != WHOLE, name


def test_sizes_and_levels_are_what_the_names_say() -> None:
    def taken(name: str) -> np.ndarray:
        return cv2.imdecode(np.frombuffer(FAULTS[name](WHOLE), np.uint8), cv2.IMREAD_COLOR)

    assert taken('black').max() == 0
    assert taken('overexposed').min() == 255
    assert taken('half_size').shape == (20, 30, 3)
    assert not FAULTS['truncated'](WHOLE).endswith(b'\xff\xd9')


def test_faults_are_named_by_photograph() -> None:
    assert parse_faults('3:black, 5:missing') == {3: 'black', 5: 'missing'}
    with pytest.raises(InputError, match='NUMBER:NAME'):
        parse_faults('3:blue')
