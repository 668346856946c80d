"""Learnt physics as JSON keeps it."""

import json

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rig import EffectDescription

OLD = {
    'density_difference': 0.0,
    'longitudinal_dispersivity': 0.0,
    'transverse_dispersivity': 0.0,
    'background_flux': [0.0, 0.0],
    'log_retardation': 0.0,
    'leaks': [],
    'patches': [],
    'scheme': 'accurate',
}
"""The content of an older model."""


def test_a_description_is_json_and_comes_back() -> None:
    leak = EffectDescription(name='leak', parameters={'x': 0.1, 'z': 0.2, 'rate': -7.2})
    learnt = LearntPhysics((leak,), 'accurate')
    described = json.loads(json.dumps(learnt.description()))
    assert LearntPhysics.from_description(described) == learnt


def test_an_older_model_is_read_if_it_learnt_a_scheme_alone() -> None:
    assert LearntPhysics.from_description(OLD) == LearntPhysics(scheme='accurate')


@pytest.mark.parametrize(('name', 'value'), [('log_retardation', 0.1), ('leaks', [{'x': 0.1}])])
def test_older_physics_is_refused_with_what_to_do(name: str, value: object) -> None:
    with pytest.raises(InputError, match='porotwin train'):
        LearntPhysics.from_description({**OLD, name: value})
