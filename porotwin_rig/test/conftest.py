"""Fixtures of the tests of the virtual rig, made from rig_examples.py."""

import pytest
from rig_examples import make_rig

from porotwin_core.rig import Rig


@pytest.fixture
def small_rig() -> Rig:
    """The small rig of the paper."""
    return make_rig()
