"""Fixtures; what they are made of is in diagnosis_examples.py."""

from pathlib import Path

import pytest
from diagnosis_examples import recorded

from porotwin_core.rig import EffectDescription


@pytest.fixture(scope='session')
def quiet(tmp_path_factory) -> Path:
    """A recording without any effect."""
    return recorded(tmp_path_factory.mktemp('quiet') / 'recording')


@pytest.fixture(scope='session')
def denser_sand(tmp_path_factory) -> Path:
    """A recording whose porosity is 12 % lower than nominal."""
    effect = EffectDescription(name='porosity', parameters={'factor': 0.88})
    return recorded(tmp_path_factory.mktemp('porosity') / 'recording', effect)
