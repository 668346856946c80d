"""The limit of a recording: its true maps against a model."""

import json
from dataclasses import replace

import pytest
from blind_examples import stated

from lab.blind.blind_cases import draw_case
from lab.blind.blind_limit import misfit_of_truth, truth_is_visible
from lab.blind.blind_study import make_recording


@pytest.fixture(scope='module')
def seen(tmp_path_factory):
    """A recording on large cells, and the file of its true maps."""
    folder = tmp_path_factory.mktemp('limit')
    case = replace(draw_case(1, 1), duration=1200.0, cell_m=0.015, element_m=0.0075)
    make_recording(case, folder / 'recording', clean=folder / 'clean.nc')
    return folder


def diagnosed(folder, misfit):
    """Return the folder of a diagnosis whose model has this `misfit`."""
    stated(folder, 'rate', 0.9, ['rate'])
    path = folder / 'diagnosis.json'
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {'misfit': {'after': misfit}}))
    return folder


def test_the_true_maps_have_the_misfit_of_the_noise(seen):
    assert 0.0 < misfit_of_truth(seen / 'recording', seen / 'clean.nc') < 0.6


@pytest.mark.parametrize(('more', 'visible'), [(0.0, False), (0.02, False), (1.0, True)])
def test_a_model_that_fits_like_the_truth_hides_it(seen, tmp_path, more, visible):
    truth = misfit_of_truth(seen / 'recording', seen / 'clean.nc')
    result = diagnosed(tmp_path / 'result', truth + more)
    assert truth_is_visible(seen / 'recording', result, seen / 'clean.nc') == visible
