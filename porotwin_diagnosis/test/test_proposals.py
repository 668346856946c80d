"""The next experiment: which one separates two explanations, and which one does not."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import ELEMENT_M, SMALL

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.advice.proposals import propose, tell_kinds_apart
from porotwin_diagnosis.advice.remainder_form import RemainderForm, Term
from porotwin_diagnosis.data.sample import coarsened, read_sample
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.findings import Findings
from porotwin_recording.experiment.recording import open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.effects import EFFECTS


@pytest.fixture(scope='module')
def sample(tmp_path_factory):
    """Tracer from one well alone: a wrong rate of that well looks like a wrong porosity."""
    folder = tmp_path_factory.mktemp('alone') / 'recording'
    injector = ScheduleRow(0.0, 'injector', WellRate(from_ml_h(450.0), 1.0))
    later = [
        ScheduleRow(2070.0, 'injector', WellRate()),
        ScheduleRow(2070.0, 'control2', WellRate(from_ml_h(300.0))),
    ]
    make_experiment(
        folder,
        VirtualRig(SMALL, cell=ELEMENT_M),
        commanded=Schedule((injector, *later)),
        duration=2160,
        photo_interval=90,
        seed=3,
        noise=MapNoise.drawn(3),
        grid=SMALL.grid(94, 56),
    )
    return coarsened(read_sample(open_recording(folder)), 2)


def proposed(sample, one, other):
    """Return the gains of experiments that separate two effects, given as (label, values)."""
    fitter = Fitter([Forward(sample)])
    candidates = {candidate.label: candidate for candidate in library([sample])}
    fits = []
    for label, values in (one, other):
        scaled = [
            parameter.scaled(value)
            for parameter, value in zip(candidates[label].parameters, values, strict=True)
        ]
        fits.append(fitter.evaluate((candidates[label],), np.array(scaled)))
    null = fitter.evaluate((), np.zeros(0))
    findings = Findings(null, null, fits, fits, distances=[0.0, 0.1])
    name = fits[0].members[0].effect
    return propose(fitter, findings, Verdict(name, 0.5, fits[0], (name,), (), {}))


def gains(proposals):
    return {proposal.name: proposal.gain for proposal in proposals if proposal.gain is not None}


def test_a_second_well_separates_a_wrong_rate_from_a_wrong_porosity(sample):
    found = proposed(sample, ('rate injector', (0.85,)), ('porosity', (1 / 0.85,)))
    assert [proposal.name for proposal in found] == [
        'check rate',
        'check porosity',
        'one well at a time',
    ]
    checks = [EFFECTS[name].laboratory_check for name in ('rate', 'porosity')]
    assert [proposal.description for proposal in found[:2]] == checks
    gain = gains(found)
    assert gain['one well at a time'] > 2.0
    assert set(gain) == {'one well at a time'}  # nothing else brings the second well in


def test_a_rest_separates_diffusion_from_dispersion(sample):
    gain = gains(proposed(sample, ('dispersion diffusion', (3e-8,)), ('dispersion', (2e-3, 2e-4))))
    assert gain['rest'] == max(gain.values())
    assert gain['rest'] > gain['double rates'] > 1.1


def test_without_a_gap_nothing_is_proposed(sample):
    fitter = Fitter([Forward(sample)])
    null = fitter.evaluate((), np.zeros(0))
    assert propose(fitter, Findings(null, null, []), Verdict('none', 0.9, null, (), (), {})) == ()


def test_beside_an_effect_without_a_probable_rival_nothing_is_proposed(sample):
    fitter = Fitter([Forward(sample)])
    null = fitter.evaluate((), np.zeros(0))
    (candidate,) = (one for one in library([sample]) if one.label == 'porosity')
    kept = fitter.evaluate((candidate,), np.zeros(1))
    findings = Findings(null, null, [kept, null], [])
    verdict = Verdict('porosity', 0.9, kept, ('porosity',), (), {'porosity': 0.99, 'leak': 0.01})
    assert not verdict.stands_alone
    alone = replace(verdict, probabilities={'porosity': 0.9999, 'leak': 0.0001})
    assert alone.stands_alone
    assert propose(fitter, findings, alone) == ()


def test_the_rival_is_the_effect_that_the_table_ranks_second_though_only_screened(sample):
    fitter = Fitter([Forward(sample)])
    candidates = {candidate.label: candidate for candidate in library([sample])}
    fits = [
        fitter.evaluate((candidates[label],), np.full(len(candidates[label].parameters), 0.1))
        for label in ('porosity', 'rate injector', 'retardation')
    ]
    kept, judged, screened = fits
    null = fitter.evaluate((), np.zeros(0))
    findings = Findings(null, null, [kept, screened, judged], [kept, judged], [0.0, 0.1])
    shares = {'porosity': 0.9, 'none': 0.05, 'retardation': 0.04, 'rate': 1e-5}
    verdict = Verdict('porosity', 0.9, kept, ('porosity',), (), shares)
    assert propose(fitter, findings, verdict)[0].separates == ('porosity', 'retardation')
    only_none = replace(verdict, probabilities={'porosity': 0.9, 'none': 0.09, 'rate': 1e-5})
    assert only_none.stands_alone


def test_an_unexplained_gap_gets_the_checks_of_its_form_and_tests_of_its_kind(sample):
    term = Term('rate injector, swinging', 'source', 0.1, '-', 'words', 'weigh the bottle')
    found = tell_kinds_apart(RemainderForm((term,), 0.6), sample)
    assert [proposal.name for proposal in found] == [
        'check: water level',
        'check: rate injector, swinging',
        'rest',
        'one well at a time',
    ]
    assert found[0].description.startswith('mark the water level at every open side')
    assert found[1].description == 'weigh the bottle'
    assert {proposal.gain for proposal in found} == {None}
