"""The search as a whole: what it refuses, and what it does once more."""

import numpy as np
import pytest
from diagnosis_examples import fit_of

from porotwin_core.errors import InputError
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.model.candidate import library
from porotwin_diagnosis.search.effect_search import (
    WORTH_EXCHANGING,
    Findings,
    Search,
    worth_exchanging,
)
from porotwin_diagnosis.search.ranking import normalised_misfit
from porotwin_recording.recording import open_recording


def test_a_search_with_nothing_to_look_for_is_refused(quiet):
    sample = read_sample(open_recording(quiet))
    names = {candidate.effect for candidate in library([sample])}
    with pytest.raises(InputError, match='excluded'):
        Search([sample], excluded=sorted(names))


def test_an_effect_that_found_its_place_beside_another_is_tried_again_alone(denser_sand):
    search = Search([read_sample(open_recording(denser_sand))], workers=1)
    judging = search.levels.judging
    known = {candidate.label: candidate for candidate in library(judging.samples)}
    porosity, saturation = known['porosity'], known['saturation']
    stuck = judging.evaluate((porosity,), np.zeros(1))
    right = porosity.parameters[0].scaled(0.885)
    pair = judging.evaluate((porosity, saturation), np.array([right, 0.0]))
    findings = Findings(stuck, stuck, [], [stuck], [pair])
    findings.parts = [judging.evaluate((porosity,), np.array([right]))]
    search._tried_again_alone(findings)
    found = findings.singles[0].effects[0].parameters['factor']
    assert found == pytest.approx(0.88, abs=0.004)
    assert normalised_misfit(findings.singles[0]) < 0.3 * normalised_misfit(stuck)


def test_members_are_exchanged_in_the_best_pair_and_in_one_that_is_all_unlike_it():
    imitation = fit_of('registration', 'leak', misfit=0.6)
    alike = fit_of('registration', 'decay', misfit=0.7)
    unlike = fit_of('porosity', 'well_position', misfit=0.9)
    further = fit_of('clock', 'depth', misfit=0.95)
    assert worth_exchanging([imitation, alike, unlike, further]) == [imitation, unlike]
    assert worth_exchanging([imitation, alike]) == [imitation]
    assert worth_exchanging([fit_of('clock', 'depth', misfit=WORTH_EXCHANGING)]) == []
    assert worth_exchanging([]) == []
