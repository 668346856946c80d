"""Corners that were read in a smaller copy of the photograph are odd; others are not."""

import pytest

from porotwin_imaging.corner_check import small_rig

CORNERS = [(100.0, 105.0), (98.0, 585.0), (902.0, 592.0), (898.0, 104.0)]
SIZE = (1000, 700)


@pytest.mark.parametrize(
    ('factor', 'shift', 'words'),
    [
        (1.0, 0.0, ''),
        (0.5, 0.0, 'the rig covers 14 % of the photograph of 1000 x 700 px, all in one quarter'),
        (0.25, 0.0, 'the rig covers 4 % of'),
        (0.5, 250.0, ''),  # in the middle of a wide view
        (0.3, 300.0, 'the rig covers 5 % of the photograph of 1000 x 700 px'),
    ],
)
def test_corners_of_a_smaller_copy_are_odd(factor: float, shift: float, words: str) -> None:
    corners = [(factor * x + shift, factor * y + shift / 2) for x, y in CORNERS]
    found = small_rig(corners, SIZE)
    assert found.startswith(words)
    assert bool(found) is bool(words)
