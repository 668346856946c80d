"""Fixtures of the tests of this package; see tests/fixtures/diagnosis_examples.py."""

from pathlib import Path

import pytest
from diagnosis_examples import CHASE, DENSER, commanded, denser_sand, quiet, recorded
from diagnosis_results import diagnosis_of_denser_sand

from porotwin_diagnosis.diagnosis import Diagnosis

__all__ = ['denser_sand', 'quiet']


@pytest.fixture(scope='session')
def injecting(tmp_path_factory) -> Path:
    """Tracer from one well alone: a lower porosity looks like a pump that delivers more."""
    folder = tmp_path_factory.mktemp('injecting') / 'injecting'
    return recorded(folder, DENSER, rates=commanded((0, 'injector', 450, 1.0)), duration=2160)


@pytest.fixture(scope='session')
def chasing(tmp_path_factory) -> Path:
    """The same sand; another well drives the tracer on."""
    folder = tmp_path_factory.mktemp('chasing') / 'chasing'
    return recorded(folder, DENSER, rates=CHASE, duration=2160, seed=4)


@pytest.fixture(scope='session')
def denser(denser_sand) -> Diagnosis:
    """The diagnosis of a lower porosity, with the true effect as if it was found."""
    return diagnosis_of_denser_sand(denser_sand)
