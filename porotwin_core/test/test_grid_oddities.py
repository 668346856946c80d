"""Tests of grids that cannot be computed, or that do not resolve a rig."""

from pathlib import Path

import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import load_rig
from porotwin_core.rig.grid_oddities import remarks_about_barriers, remarks_about_grid

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


@pytest.mark.parametrize(('text', 'leaks'), [('240x140', False), ('120x70', True), ('60x35', True)])
def test_a_barrier_too_thin_for_the_cells_is_named(tmp_path: Path, text: str, leaks: bool) -> None:
    (tmp_path / 'rig.yaml').write_text(
        'name: fault\nwidth_m: 1.2\nheight_m: 0.7\ndepth_m: 0.01\nsands:\n'
        '  coarse: {porosity: 0.4, permeability_m2: 1.0e-9}\n'
        '  clay: {porosity: 0.4, permeability_m2: 1.0e-14}\n'
        'sand_layers: [{sand: coarse}]\nsand_polygons:\n'
        '  - {sand: clay, corners_m: [[0.602, 0], [0.614, 0], [0.614, 0.7], [0.602, 0.7]]}\n'
        'viscosity_pa_s: 1.0e-3\ndensity_kg_m3: 998.0\n'
        'boundaries: {top: open, bottom: closed, left: closed, right: closed}\n'
        'wells: {injector: {x_m: 0.2, z_m: 0.1}}\n'
    )
    rig = load_rig(tmp_path)
    remarks = list(remarks_about_barriers(Grid.parse(text, rig.width_m, rig.height_m), rig))
    assert bool(remarks) is leaks
    for remark in remarks:
        assert 'mm wide where cells measure' in str(remark)
        assert 'cells of at most' in str(remark)
