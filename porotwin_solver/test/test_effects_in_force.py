"""Tests of the effects that may act in a running model."""

from collections.abc import Mapping

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_solver.service.effects_in_force import checked_effects, in_words


def described(name: str, **parameters: float | str) -> EffectDescription:
    """Return an effect with its parameters."""
    return EffectDescription(name=name, parameters=parameters)


@pytest.mark.parametrize(
    ('name', 'parameters', 'message'),
    [
        ('sorption', {}, "effect 'sorption': unknown; choose from"),
        ('decay', {'speed': 1.0}, "unknown parameter 'speed'; known: rate"),
        ('rate', {'well': 'nowhere', 'factor': 0.9}, "well 'nowhere' is not in rig.yaml; known"),
        ('leak', {'x': 2.0, 'z': 0.1, 'rate': 10.0}, 'lies outside the rig of 0.934 m'),
        ('saturation', {'exponent': 1.4}, 'is of the camera, and the solver makes no photographs'),
        ('numerical_diffusion', {'model_diffusion': 1e-8}, 'choose another --preset'),
        ('buoyancy', {'density_difference': 1e12}, 'difference = 1e[+]12: must be at most 1000'),
        ('porosity', {'factor': 1e-12}, 'factor = 1e-12: must be at least 0.01'),
        (
            'heterogeneity',
            {'x': 0.5, 'z': 0.3, 'radius': 0.1, 'permeability_factor': 1e30},
            'permeability_factor = 1e[+]30: must be at most 1e[+]09',
        ),
    ],
)
def test_effects_that_the_model_cannot_have_are_refused(
    rig, name: str, parameters: Mapping[str, float | str], message: str
) -> None:
    with pytest.raises(InputError, match=message) as refused:
        checked_effects(rig, [described(name, **parameters)])
    assert '\n' not in str(refused.value)


def test_a_checked_effect_has_all_its_parameters(rig) -> None:
    (found,) = checked_effects(rig, [described('retardation', retardation_factor=1.1)])
    assert found.parameters == {'retardation_factor': 1.1}


def test_effects_are_told_in_plain_words() -> None:
    pump = described('rate', well='injector', factor=0.7)
    gain = described('leak', x=0.5, z=0.1, rate=1e-7)
    assert in_words([pump]) == 'pump injector delivers 70 % of the commanded rate'
    assert in_words([gain, pump]).endswith('1·10⁻⁷ ml/h, and ' + in_words([pump]))
    assert in_words([]) == 'the model as rig.yaml describes it'
