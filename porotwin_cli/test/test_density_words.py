"""Tests of the words about density: a rig whose speed and radius are known."""

import math
from pathlib import Path

import pytest
import yaml
from box_rig import box_rig

from porotwin_cli.checking.density_words import density_words
from porotwin_core.basis.units import GRAVITY
from porotwin_core.rig import Rig, load_rig
from porotwin_solver.effects.definition.words import number


def rig(permeability_m2: float) -> Rig:
    return box_rig().model_copy(update={'permeability_m2': permeability_m2})


def test_the_way_and_the_radius_are_those_of_the_formulas():
    found = rig(1e-10)
    hour, stock = 3600.0, 1e-5
    way = 1e-10 * GRAVITY / (found.viscosity_pa_s * 0.4) * hour
    radius = math.sqrt(stock / (math.pi * 0.4 * 0.02))
    words = density_words(found, found.default_grid(), stock, hour)
    assert f'{number(1e3 * way, 2)} mm by itself' in words
    assert f'radius of {number(1e3 * radius, 2)} mm' in words


@pytest.mark.parametrize(('permeability', 'warned'), [(1e-12, False), (1e-9, True)])
def test_only_a_notable_way_asks_for_a_measurement(permeability, warned):
    box = rig(permeability)
    words = density_words(box, box.default_grid(), 1e-5, 3600.0)
    assert ('weigh stock' in words) is warned


def test_the_sand_is_the_most_permeable_one(tmp_path: Path):
    described = {
        **box_rig().model_dump(include={'name', 'width_m', 'height_m', 'depth_m'}),
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'wells': {'in': {'x_m': 0.05, 'z_m': 0.05}},
        'sands': {
            'fine': {'porosity': 0.3, 'permeability_m2': 1e-11},
            'coarse': {'porosity': 0.4, 'permeability_m2': 1e-9},
        },
        'sand_layers': [{'sand': 'coarse', 'top_m': 0.02}, {'sand': 'fine'}],
    }
    (tmp_path / 'rig.yaml').write_text(yaml.safe_dump(described))
    found = load_rig(tmp_path)
    words = density_words(found, found.default_grid(), 1e-5, 60.0)
    way = number(1e3 * 1e-9 * GRAVITY / (1e-3 * 0.4) * 60.0, 2)
    assert f'{way} mm by itself in this time in the most permeable sand, coarse;' in words
