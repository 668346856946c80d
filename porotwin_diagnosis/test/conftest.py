"""Recordings as fixtures, made with diagnosis_examples.py."""

from pathlib import Path

import pytest
from diagnosis_examples import CHASE, DENSER, commanded, recorded
from diagnosis_results import diagnosis_of_denser_sand

from porotwin_diagnosis.diagnosis import Diagnosis


@pytest.fixture(scope='session')
def quiet(tmp_path_factory) -> Path:
    """A recording without any effect."""
    return recorded(tmp_path_factory.mktemp('quiet') / 'recording')


@pytest.fixture(scope='session')
def denser_sand(tmp_path_factory) -> Path:
    """A recording whose porosity is 12 % lower than the nominal one."""
    return recorded(tmp_path_factory.mktemp('porosity') / 'recording', DENSER)


@pytest.fixture(scope='session')
def injecting(tmp_path_factory) -> Path:
    """Tracer from one well alone: a lower porosity looks like a pump that delivers more."""
    folder = tmp_path_factory.mktemp('injecting') / 'injecting'
    return recorded(folder, DENSER, told=commanded((0, 'injector', 450, 1.0)), duration=2160)


@pytest.fixture(scope='session')
def chasing(tmp_path_factory) -> Path:
    """The same sand; another well drives the tracer on."""
    folder = tmp_path_factory.mktemp('chasing') / 'chasing'
    return recorded(folder, DENSER, told=CHASE, duration=2160, seed=4)


@pytest.fixture(scope='session')
def denser(denser_sand) -> Diagnosis:
    """The diagnosis of a lower porosity, with the true effect as if it was found."""
    return diagnosis_of_denser_sand(denser_sand)
