"""Tests of grids that cannot be computed, or that do not resolve a rig."""

from pathlib import Path

import pytest

from porotwin_core.grid import Grid
from porotwin_core.rig import load_rig
from porotwin_core.rig.grid_oddities import remarks_about_grid

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')


@pytest.mark.parametrize('text', ['187x112', '94x56', '280x150', '374x224'])
def test_usual_grids_are_not_odd(text: str) -> None:
    assert remarks_about_grid(Grid.parse(text, RIG.width_m, RIG.height_m), RIG) == ()


@pytest.mark.parametrize(
    ('text', 'named', 'refused'),
    [
        ('100000x5', 'measure 0.00934 mm x 112 mm', True),
        ('5x100000', 'mm x 0.00562 mm', True),
        ('2000x1000', '2,000,000 cells', True),
        ('187x30', 'measure 4.99 mm x 18.7 mm', False),
        ('9x5', 'cells lie between the wells', False),
    ],
)
def test_an_odd_grid_is_explained_with_a_better_one(text: str, named: str, refused: bool) -> None:
    first = remarks_about_grid(Grid.parse(text, RIG.width_m, RIG.height_m), RIG)[0]
    assert named in str(first)
    assert '187x112' in str(first)
    assert first.refused is refused
