"""Draws of the blind check: the same cases for the same seed, release after release."""

import pytest

from lab.blind.blind_cases import LEFT_OUT, draw_case
from lab.blind.blind_effects import PAIR_GROUPS, equal_names
from porotwin_cli.running.drawn_effects import LIBRARY, OUTSIDE
from porotwin_core.rig import EffectDescription
from porotwin_solver.effects.definition.effect import Appearance

PUBLISHED = {
    1: ('single', {'viscosity': {'viscosity_ratio': 1.48792134}}),
    2: ('outside', {'settling': {'velocity': 6.85631241e-06}}),
    4: (
        'pair',
        {
            'saturation': {'exponent': 1.66667729},
            'well_position': {'well': 'injector', 'dx': 0.00409825686, 'dz': -0.00230066192},
        },
    ),
    9: (
        'single',
        {
            'heterogeneity': {
                'x': 0.247430663,
                'z': 0.36480792,
                'radius': 0.0449089978,
                'permeability_factor': 0.100917847,
            }
        },
    ),
    15: ('left out', {'saturation': {'exponent': 1.86982917}}),
    16: ('pair', {'decay': {'rate': 6.82933101e-05}, 'clock': {'offset': -65.8402429}}),
    19: (
        'outside',
        {
            'streak': {
                'x': 0.128366654,
                'z': 0.260137067,
                'x_end': 0.208366654,
                'z_end': 0.420137067,
                'width': 0.006,
                'permeability_factor': 0.139641981,
            }
        },
    ),
    21: ('single', {'leak': {'x': 0.955033777, 'z': 0.68907967, 'rate': 101.232634}}),
}
"""Cases of seed 14; the figures in docs/figures come from this seed."""

PUBLISHED_SIZES = 17, 9
"""Effects in the library and outside it, which took turns in those cases."""


@pytest.mark.parametrize('number', PUBLISHED)
def test_a_seed_draws_the_cases_of_the_published_figures(number):
    if (len(LIBRARY), len(OUTSIDE)) != PUBLISHED_SIZES:
        pytest.skip('a new effect takes its turn; the published figures belong to the old library')
    kind, effects = PUBLISHED[number]
    case = draw_case(number, 14)
    assert case.kind == kind
    assert [effect.name for effect in case.effects] == list(effects)
    for effect, expected in zip(case.effects, effects.values(), strict=True):
        assert effect.parameters.keys() == expected.keys()
        for name, value in expected.items():
            assert effect.parameters[name] == (
                value if isinstance(value, str) else pytest.approx(value, rel=1e-8)
            )


def test_pairs_are_drawn_from_groups_that_show_differently():
    assert all(len(set(group)) == len(group) for group in PAIR_GROUPS)
    assert len(PAIR_GROUPS) == len(Appearance)
    members = {name for group in PAIR_GROUPS for name in group}
    assert members <= LIBRARY.keys()
    assert not OUTSIDE.keys() & LIBRARY.keys()


def test_effects_that_no_map_can_tell_apart_are_all_right():
    def right(name, **parameters):
        return equal_names(EffectDescription(name=name, parameters=parameters))

    assert right('retardation', retardation_factor=1.1) == ('retardation', 'porosity')
    assert right('porosity', factor=1.1) == ('retardation', 'porosity')
    assert right('porosity', factor=0.9) == ('porosity',)
    assert right('streak') == ()
    assert right('settling') == ('background_flow',)
    assert right('freundlich') == ('retardation', 'porosity')
    assert not {'porosity', 'retardation'} & set(LEFT_OUT)
