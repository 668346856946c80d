"""The search as a whole; its results are tested in test_examine.py."""

import numpy as np
import pytest
from diagnosis_examples import candidate, sample_of

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.progress import MOST
from porotwin_diagnosis.search.effect_search import fitted_again_alone, search_effects
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.ranking import normalised_misfit


def test_a_search_without_effects_is_refused_before_any_simulation(quiet):
    sample = sample_of(quiet)
    names = {each.effect for each in library([sample])}
    stages = []
    with pytest.raises(InputError, match='excluded'):
        search_effects(
            [sample], excluded=sorted(names), progress=lambda stage, _: stages.append(stage)
        )
    assert stages == []


def test_a_search_names_the_effect_and_returns_its_levels(denser_sand):
    sample = sample_of(denser_sand)
    kept = {'porosity', 'saturation'}
    excluded = {each.effect for each in library([sample])} - kept
    levels, findings = search_effects([sample], excluded=excluded)
    assert findings.singles[0].label == 'porosity'
    assert findings.distances[0] == 0.0
    assert findings.runs == levels.simulations
    assert normalised_misfit(findings.singles[0]) < normalised_misfit(findings.null)


def test_a_member_that_was_stuck_alone_is_fitted_again(denser_sand):
    """The member found its parameters beside another effect only."""
    sample = sample_of(denser_sand)
    positions = []
    levels = make_levels([sample], progress=lambda _stage, position: positions.append(position))
    judging = levels.judging
    porosity, saturation = (candidate([sample], name) for name in ('porosity', 'saturation'))
    stuck = judging.evaluate((porosity,), np.zeros(1))
    right = porosity.parameters[0].scaled(0.885)
    pair = judging.evaluate((porosity, saturation), np.array([right, 0.0]))
    alone = judging.evaluate((porosity,), np.array([right]))
    findings = Findings(stuck, stuck, [], singles=[stuck], pairs=[pair], parts=[alone])
    _, singles = fitted_again_alone(levels, findings, 0.52)
    assert singles[0].effects[0].parameters['factor'] == pytest.approx(0.88, abs=0.004)
    assert normalised_misfit(singles[0]) < 0.3 * normalised_misfit(stuck)
    before_triples = sorted(MOST)[3]
    assert positions[0] == 0.52
    assert 0.52 < max(positions) <= before_triples, 'the search for a third effect follows'
