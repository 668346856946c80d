"""Places and plans in words."""

from pathlib import Path

from porotwin_cli.checking.plan_words import place_words, plan_words
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import parse_rig

RIG = {
    'name': 'tank',
    'width_m': 0.9,
    'height_m': 0.3,
    'depth_m': 0.02,
    'viscosity_pa_s': 1e-3,
    'density_kg_m3': 998.0,
    'sands': {
        'fine': {'porosity': 0.4, 'permeability_m2': 1e-10},
        'coarse': {'porosity': 0.4, 'permeability_m2': 1e-9},
    },
    'sand_layers': [{'sand': 'fine', 'top_m': 0.2}, {'sand': 'coarse'}],
    'boundaries': {'top': 'closed'},
    'water': {
        'canal': {'corners_m': [[0, 0.1], [0.02, 0.1], [0.02, 0.2], [0, 0.2]], 'head_m': 0.2}
    },
    'wells': {'well': {'x_m': 0.8, 'z_m': 0.25}, 'deep': {'x_m': 0.25, 'z_m': 0.05}},
}


def test_every_place_has_its_part_of_the_rig_and_its_sand() -> None:
    words = place_words(parse_rig(RIG, Path('rig.yaml')))
    for told in ('well upper right in coarse', 'deep lower left in fine', 'canal middle left'):
        assert told in words


def test_a_plan_tells_its_changes_and_the_volume_of_each_well() -> None:
    running = {'in': WellRate(from_ml_h(600.0), 1.0), 'out': WellRate(from_ml_h(-600.0))}
    rates = Schedule.from_rates([(0.0, running), (360.0, {}), (720.0, running), (1080.0, {})])
    words = plan_words(rates, rates, 1800.0)
    assert 'change 3 times, first at 6 min, last at 18 min; into the sand until 30 min' in words
    assert 'in +120 ml, out -120 ml' in words
    assert 'do not change' in plan_words(Schedule.constant(running), rates, 60.0)
