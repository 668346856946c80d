"""Traits of single effects."""

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.effect_traits import (
    has_place,
    is_slow_on_fine_grids,
    misfit_allowance,
    needs_simulation,
)


def viscosity(ratio):
    return EffectDescription(name='viscosity', parameters={'viscosity_ratio': ratio})


def test_only_effects_of_the_camera_need_no_simulation():
    assert not needs_simulation('registration')
    assert needs_simulation('clock')
    assert needs_simulation('porosity')


def test_a_leak_and_a_zone_have_a_place():
    assert [name for name in ('leak', 'heterogeneity', 'rate') if has_place(name)] == [
        'leak',
        'heterogeneity',
    ]


def test_traits_of_a_combination_are_those_of_its_worst_member():
    assert misfit_allowance(['porosity', 'viscosity']) == misfit_allowance(['viscosity']) > 1.0
    assert misfit_allowance([]) == misfit_allowance(['porosity']) == 1.0
    slow = EffectDescription(name='dispersion', parameters={})
    assert is_slow_on_fine_grids([viscosity(0.9), slow])
    assert not is_slow_on_fine_grids([viscosity(0.9)])
