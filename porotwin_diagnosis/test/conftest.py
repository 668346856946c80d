"""Fixtures of the tests of this package; see tests/fixtures/diagnosis_examples.py."""

from pathlib import Path

import pytest
from diagnosis_examples import (
    CHASE,
    DENSER,
    candidate,
    commanded,
    denser_sand,
    quiet,
    recorded,
    sample_of,
)
from diagnosis_results import diagnosis_of_denser_sand
from undrawn_pictures import undrawn

from lab.blind.blind_cases import SMALL
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_solver.effects.definition.candidate import Candidate

__all__ = ['denser_sand', 'quiet', 'undrawn']


@pytest.fixture(scope='session')
def injecting(tmp_path_factory) -> Path:
    """Tracer from one well alone: a lower porosity looks like a pump that delivers more."""
    folder = tmp_path_factory.mktemp('injecting') / 'injecting'
    return recorded(
        folder,
        DENSER,
        rates=commanded((0, 'injector', 450, 1.0)),
        duration=2160,
        grid=SMALL.grid(62, 37),
    )


@pytest.fixture(scope='session')
def chasing(tmp_path_factory) -> Path:
    """The same sand; another well drives the tracer on."""
    folder = tmp_path_factory.mktemp('chasing') / 'chasing'
    return recorded(folder, DENSER, rates=CHASE, duration=2160, seed=4, grid=SMALL.grid(62, 37))


@pytest.fixture(scope='session')
def denser(denser_sand) -> Diagnosis:
    """The diagnosis of a lower porosity, with the true effect as if it was found."""
    return diagnosis_of_denser_sand(denser_sand)


@pytest.fixture(scope='session')
def coarse_denser(tmp_path_factory) -> Diagnosis:
    """The same on large cells, for tests of pages and files: the model runs again for each page."""
    folder = tmp_path_factory.mktemp('coarse') / 'recording'
    return diagnosis_of_denser_sand(recorded(folder, DENSER, grid=SMALL.grid(47, 28)))


@pytest.fixture(scope='session')
def fitter(denser_sand) -> Fitter:
    """Fits to the recording of a lower porosity, on its own cells."""
    return Fitter([Forward(sample_of(denser_sand), point_spread_width=0.3)])


@pytest.fixture(scope='session')
def porosity(fitter) -> Candidate:
    """The effect that the recording of `fitter` hides."""
    return candidate(fitter.samples, 'porosity')
