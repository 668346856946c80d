"""Drawings of maps on a rig."""

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from porotwin_cli.pictures.rig_drawing import MOST_MAPS, chosen_maps, draw_map
from porotwin_cli.workspace import ROOT
from porotwin_core.rig import load_rig
from porotwin_core.rig.rig_on_axes import OPEN_WATER, WATER


def test_a_sheet_shows_the_first_and_the_last_map_and_some_between() -> None:
    assert chosen_maps(1) == [0]
    assert chosen_maps(3) == [0, 1, 2]
    assert chosen_maps(101) == [0, 20, 40, 60, 80, 100]
    assert len(chosen_maps(1000)) == MOST_MAPS


def test_a_map_shows_open_water_and_the_water_at_its_sides() -> None:
    for name in ('pennink_milk', 'pennink_rain', 'small'):
        rig, axis = load_rig(ROOT / 'rigs' / name), Figure().subplots()
        draw_map(axis, rig, np.zeros((4, 6)))
        canals = sum(body.side is None for body in rig.water_bodies.values())
        fills = [one for one in axis.patches if to_hex(one.get_facecolor()) == OPEN_WATER]
        lines = [one for one in axis.lines if one.get_color() == WATER]
        assert (len(fills), len(lines)) == (canals, len(rig.water_bodies) - canals)
