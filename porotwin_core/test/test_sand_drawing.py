"""Tests of the sands: layers, polygons and pictures on every grid, and a rig of them in files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import MOST_SQUARES
from porotwin_core.rig import load_rig, parse_rig, write_rig
from porotwin_core.rig.sand_drawing import sand_raster

SANDS: dict[str, Any] = {
    'coarse': {'porosity': 0.44, 'permeability_m2': 1.0e-9},
    'fine': {'porosity': 0.40, 'hydraulic_conductivity_m_s': 1.0e-3},
}
RIG: dict[str, Any] = {
    'name': 'two sands',
    'width_m': 0.6,
    'height_m': 0.4,
    'depth_m': {'points': [[0.0, 0.2, 0.010], [0.6, 0.2, 0.016]]},
    'viscosity_pa_s': 1.0e-3,
    'density_kg_m3': 1000.0,
    'wells': {'injector': {'x_m': 0.1, 'z_m': 0.1}},
    'sands': SANDS,
    'sand_layers': [
        {'sand': 'coarse', 'top_m': 0.1},
        {'sand': 'fine', 'top_m': [[0.0, 0.2], [0.6, 0.3]]},
        {'sand': 'coarse'},
    ],
    'sand_polygons': [{'sand': 'coarse', 'corners_m': [[0, 0], [0.05, 0], [0.05, 0.4], [0, 0.4]]}],
}
FINE = 1.0e-3 * 1.0e-3 / (1000.0 * 9.81)


def test_layers_lie_below_their_tops_and_polygons_over_them() -> None:
    rig = parse_rig(RIG, Path('rig.yaml'))
    permeability = rig.nominal_map('permeability_m2')
    assert isinstance(permeability, np.ndarray)
    assert permeability.shape == (200, 300)
    fine = np.isclose(permeability, FINE, rtol=1e-12, atol=0.0)
    assert np.isclose(permeability[~fine], 1.0e-9, atol=0.0).all()
    assert not fine[:, :25].any()
    heights = (np.arange(200) + 0.5) * 0.002
    for column, top in ((30, 0.2 + 0.1 * 0.061 / 0.6), (299, 0.3 - 0.1 * 0.001 / 0.6)):
        np.testing.assert_array_equal(fine[:, column], (heights > 0.1) & (heights < top))


@pytest.mark.parametrize('shape', [(7, 11), (40, 60), (400, 600)])
def test_every_grid_holds_the_same_sand(shape: tuple[int, int]) -> None:
    rig = parse_rig(RIG, Path('rig.yaml'))
    field = rig.field('porosity', rig.grid(shape[1], shape[0]))
    area = 0.55 * (0.1 + 0.1 * 0.325 / 0.6)  # of fine sand: a trapezium beside the polygon
    assert field.mean() == pytest.approx(0.44 - 0.04 * area / 0.24, abs=2e-4)
    assert field.min() >= 0.40 - 1e-12


def test_the_points_of_depth_become_a_map() -> None:
    rig = parse_rig(RIG, Path('rig.yaml'))
    depth = rig.field('depth_m', rig.grid(60, 40))
    np.testing.assert_allclose(depth[3], 0.010 + 0.01 * (np.arange(60) + 0.5) / 100)


def test_a_large_rig_has_larger_squares() -> None:
    raster = sand_raster(2.8, 1.5)
    assert raster.nx * raster.nz == pytest.approx(MOST_SQUARES, rel=0.01)


def test_a_rig_of_layers_survives_writing_and_reading(tmp_path: Path) -> None:
    rig = parse_rig(RIG, Path('rig.yaml'))
    write_rig(rig, tmp_path / 'rig.yaml')
    assert load_rig(tmp_path) == rig
    assert [path.name for path in tmp_path.iterdir()] == ['rig.yaml']
    assert yaml.safe_load((tmp_path / 'rig.yaml').read_text())['sands'] == SANDS


def picture(path: Path) -> None:
    """Draw fine sand in the upper half, coarse sand below."""
    pixels = np.full((40, 60, 3), (200, 120, 40), np.uint8)
    pixels[:20] = (240, 240, 220)
    Image.fromarray(pixels).save(path)


def image_rig(legend: dict[str, str]) -> dict[str, Any]:
    data = {key: value for key, value in RIG.items() if not key.startswith('sand_')}
    return {**data, 'sand_image': {'file': 'sands.png', 'legend': legend}}


LEGEND = {'#c87828': 'coarse', '#f0f0dc': 'fine'}


def test_a_picture_gives_every_place_its_sand_and_travels_with_the_rig(tmp_path: Path) -> None:
    picture(tmp_path / 'sands.png')
    rig = parse_rig(image_rig(LEGEND), tmp_path / 'rig.yaml')
    porosity = rig.field('porosity', rig.grid(6, 4))
    np.testing.assert_allclose(porosity[:2], 0.44)
    np.testing.assert_allclose(porosity[2:], 0.40)
    (tmp_path / 'copy').mkdir()
    write_rig(rig, tmp_path / 'copy' / 'rig.yaml')
    assert load_rig(tmp_path / 'copy') == rig
    assert (tmp_path / 'copy' / 'sands.png').read_bytes() == (tmp_path / 'sands.png').read_bytes()


def test_a_picture_of_another_shape_than_the_rig_is_refused(tmp_path: Path) -> None:
    Image.new('RGB', (60, 60), '#c87828').save(tmp_path / 'sands.png')
    with pytest.raises(InputError, match=r'60 x 60 pixels do not .* such as 500 x 333 pixels'):
        parse_rig(image_rig(LEGEND), tmp_path / 'rig.yaml')


@pytest.mark.parametrize(
    ('legend', 'named'),
    [
        ({'#c87828': 'coarse'}, '50 % of the picture has colours such as #f0f0dc'),
        ({'#c87828': 'coarse', 'sandy': 'fine'}, "write colours like '#c08040'"),
        ({'#c87828': 'gravel'}, "sand 'gravel' is unknown; sands has coarse, fine"),
    ],
)
def test_a_wrong_legend_is_refused(legend: dict[str, str], named: str, tmp_path: Path) -> None:
    picture(tmp_path / 'sands.png')
    with pytest.raises(InputError, match=named):
        parse_rig(image_rig(legend), tmp_path / 'rig.yaml')


@pytest.mark.parametrize(
    ('change', 'named'),
    [
        ({'porosity': 0.4}, 'porosity and sands both describe the sand'),
        ({'sand_layers': []}, 'either sand_layers or sand_image'),
        ({'sand_layers': [{'sand': 'coarse', 'top_m': 0.1}]}, 'the last of sand_layers fills'),
        ({'sand_layers': [{'sand': 'coarse'}, {'sand': 'fine'}]}, 'layer 1 of sand_layers needs'),
        ({'sand_layers': [{'sand': 'clay'}]}, "sand 'clay' is unknown"),
        ({'sands': {}}, "'sands' is missing"),
        ({'sands': {**SANDS, 'fine': {'porosity': 0.4}}}, 'give either permeability_m2'),
        (
            {'sand_layers': [{'sand': 'fine', 'top_m': [[1, 0.2], [0, 0.3]]}, {'sand': 'fine'}]},
            'must run from left to right',
        ),
        ({'sands': {**SANDS, 'mud': SANDS['fine']}, 'depth_m': 'deep'}, 'write the number alone'),
        ({'sand_image': {'file': 'no.png', 'legend': LEGEND}}, 'either sand_layers or'),
    ],
)
def test_a_mistake_about_sands_is_named_on_one_line(change: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named) as caught:
        parse_rig({**RIG, **change}, Path('rig.yaml'))
    assert '\n' not in str(caught.value)


def test_a_single_sand_may_have_a_hydraulic_conductivity() -> None:
    plain = {key: value for key, value in RIG.items() if not key.startswith('sand')}
    data = {**plain, 'porosity': 0.4, 'hydraulic_conductivity_m_s': 1.0e-3}
    rig = parse_rig(data, Path('rig.yaml'))
    assert rig.nominal_map('permeability_m2') == pytest.approx(FINE)
    same = parse_rig({**plain, 'porosity': 0.4, 'permeability_m2': FINE}, Path('rig.yaml'))
    assert rig.physics_fingerprint == same.physics_fingerprint
