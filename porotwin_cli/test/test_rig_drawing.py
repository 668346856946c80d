"""Drawings of maps on a rig."""

from porotwin_cli.pictures.rig_drawing import MOST_MAPS, chosen_maps


def test_a_sheet_shows_the_first_and_the_last_map_and_some_between() -> None:
    assert chosen_maps(1) == [0]
    assert chosen_maps(3) == [0, 1, 2]
    assert chosen_maps(101) == [0, 20, 40, 60, 80, 100]
    assert len(chosen_maps(1000)) == MOST_MAPS
