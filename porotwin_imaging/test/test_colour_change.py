"""Boxes of the rig, and the change of colour since the baseline."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.phases.colour_change import Box, box_of, colour_change


def test_a_box_is_read_and_written() -> None:
    box = box_of('0.1,0.2,0.3,0.44@60', '--gas')
    assert box == Box(0.1, 0.2, 0.3, 0.44, 60.0)
    assert str(box) == '0.1,0.2,0.3,0.44@60'
    assert box.cells(Grid(10, 10, 1.0, 1.0)).sum() == 2 * 2


@pytest.mark.parametrize('text', ['', '1,2,3', '0,0,1,1@x', 'a,b,c,d', '0.3,0,0.1,1', 'nan,0,1,1'])
def test_a_box_that_is_none_is_refused(text) -> None:
    with pytest.raises(InputError, match='--gas'):
        box_of(text, '--gas')


def test_a_box_outside_the_rig_is_refused() -> None:
    with pytest.raises(InputError, match='no cell of the rig'):
        Box(2.0, 0.0, 3.0, 1.0).cells(Grid(10, 10, 1.0, 1.0))


def test_a_dark_object_is_left_out_a_bright_one_in_doubt_and_a_plume_neither(
    laboratory, baseline, true_map, make_jpeg
) -> None:
    light = laboratory.scene(true_map)
    light[200:330, 600:730] = [0.1, 0.06, 0.05]
    light[400:530, 600:730] = [0.5, 0.4, 0.4]
    change = colour_change(make_jpeg(light), baseline)
    plume = true_map.reshape(50, 9, 90, 9).mean(axis=(1, 3)) > 0.5
    assert change.visible[plume].all()
    assert not change.visible[::-1][8:18, 64:75].any()
    assert change.doubtful[::-1][30:40, 64:75].all()
    assert any('covered' in line for line in change.remarks)
