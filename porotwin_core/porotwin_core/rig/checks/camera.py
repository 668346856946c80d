"""Do the corners of the camera make a picture of the rig?"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.polygons import signed_area
from porotwin_core.rig.description import Rig
from porotwin_core.rig.sections import Pixel


def _corners(rig: Rig) -> Iterator[Remark]:
    if rig.camera is None:
        return
    order = 'upper left, lower left, lower right, upper right'
    chart = 'dark skin, white, black, bluish green'
    yield from _quadrangle('camera.corners_px', rig.camera.corners_px, order)
    if rig.camera.colour_checker_px is not None:
        yield from _quadrangle('camera.colour_checker_px', rig.camera.colour_checker_px, chart)
    upper_left, lower_left, lower_right, _ = rig.camera.corners_px
    sideways = abs(lower_left[1] - upper_left[1]) < abs(lower_left[0] - upper_left[0])
    if sideways or lower_left[1] < upper_left[1] or lower_right[0] < lower_left[0]:
        yield Remark(
            'camera.corners_px',
            '',
            'by this order the rig lies on its side or upside down in the photographs',
            f'give {order}, unless the camera is turned',
        )


def _quadrangle(key: str, corners: tuple[Pixel, ...], order: str) -> Iterator[Remark]:
    polygon = np.array(corners)
    turns = [_turn(*(polygon[(index + step) % 4] for step in range(3))) for index in range(4)]
    if any(turn == 0 for turn in turns) or len({turn > 0 for turn in turns}) > 1:
        why = 'the four corners make no quadrangle without a dent'
        yield Remark(key, '', why, f'give {order} as (column, row)', refused=True)
    elif signed_area(polygon) > 0:  # rows count downward: this order turns the other way round
        why = 'in this order the corners show a mirror image'
        yield Remark(key, '', why, f'give {order} as (column, row)', refused=True)


def _turn(a: Any, b: Any, c: Any) -> float:
    return float((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]))


CHECK = Check(find=_corners)
