"""What a fit learns on the way from coarse to fine cells."""

import pytest

from porotwin_core.grid import relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import score
from porotwin_recording.recording import open_recording
from porotwin_rig.map_camera import MapNoise


def levels_of(recording):
    sample = read_sample(open_recording(recording))
    return Levels([sample], progress=lambda _stage, _share: None, workers=1)


def test_the_blur_of_edges_is_measured_with_the_model_that_fits(quiet):
    levels = levels_of(quiet)
    null = levels.null()
    levels.measure_blur(null)
    assert levels.judging.soft == pytest.approx(MapNoise.drawn(3).blur_cells, abs=0.2)
    assert levels.null().fitted <= null.fitted + 1e-6


def test_one_run_on_finer_cells_tells_what_the_judging_cells_do_wrong(quiet):
    levels = levels_of(quiet)
    before = levels.null()
    levels.attune(before)
    after = levels.null()
    assert score(after) < score(before)
    assert levels.judging.forwards[0].offset is not None


def test_what_an_effect_changes_is_measured_where_fronts_are_sharp(denser_sand):
    """A bent response changes nothing but soft fronts, and the scheme's own are soft."""
    levels = levels_of(denser_sand)
    bent = EffectDescription(name='saturation', parameters={'exponent': 0.7})
    coarse = levels.refining.forwards[0]
    begin = coarse.sample.fitted
    smeared = relative_error(coarse.maps((bent,))[begin:], coarse.maps(())[begin:])
    assert 0.0 < levels.change((bent,)) < 0.8 * smeared
