"""Tests of the colours of wells."""

from pathlib import Path

from porotwin_core.rig import load_rig
from porotwin_core.rig.well_colours import COLOURS, well_colours

RIG = load_rig(Path(__file__).parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')


def test_a_well_has_the_colour_of_its_place_in_the_rig() -> None:
    colours = well_colours(RIG)
    assert list(colours) == list(RIG.wells)
    assert list(colours.values()) == list(COLOURS[: len(colours)])
