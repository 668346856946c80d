"""The first screen of the report: the facts of the answer, and the words of its template."""

import re
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_results import naming, no_gap, twice, with_effects

from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.partial_cause import PartialCause
from porotwin_diagnosis.advice.remainder_form import RemainderForm, Term
from porotwin_diagnosis.decision.compared_readings import ComparedReading
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.gap_map import Spot
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.report.answer import ActingPlace, answer_of
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_recording.tables.concentration import MapOrigin
from porotwin_solver.effects import EFFECTS

TERM = Term('level', 'camera', -0.1, '-', 'the plume is 10 % paler throughout', 'dilute it')
BOTTLE = GaugeReading(2160.0, GaugeKind.OUTFLOW, -270e-6, 5e-6, 'injector')
READING = ComparedReading(BOTTLE, -250e-6, -269e-6)
"""A reading four deviations off before and a fifth of one after."""


def facts(result, **verdict):
    """Return the answer on `result` with changes of its verdict."""
    changed = replace(result, verdict=replace(result.verdict, **verdict))
    return answer_of(changed, diagnosis_json(changed))


def unexplained(result, form=None, closed=None, *, spot=None, rest=0.0):
    """Return an unexplained gap; a part of it is `closed`, with a place and a form of the rest."""
    worst, pair = result.evidence.findings.singles[1], result.evidence.findings.pairs[0]
    verdict = Verdict('unexplained', 0.9, worst, (), (), {'porosity': 0.1})
    beside = RemainderForm((TERM,) if rest else (), rest)
    part = PartialCause(pair, closed, beside, spot) if closed else None
    return replace(result, verdict=verdict, remainder=form, partial=part)


def held_out(result, **changes):
    return replace(result, held_out=(replace(result.held_out[0], **changes),))


def hidden(result, **changes):
    """Return `result` with an error that falls only with the blur of the camera, if at all."""
    return held_out(result, error_after=result.held_out[0].error_before + 0.01, **changes)


def calibrated(result, told=True):
    maps = replace(result.recordings[0].maps, origin=MapOrigin(told))
    return replace(result, recordings=(replace(result.recordings[0], maps=maps),))


def inseparable_pairs(result):
    """Return a pair that looks like another one, with retardation instead of porosity."""
    known = {candidate.effect: candidate for candidate in library([result.samples[0]])}
    members = (known['retardation'], known['rate'])
    scaled = np.array([members[0].parameters[0].scaled(1.15), 0.5])
    other = Fit(members, scaled, 0.5, 0.5, 0.1, 0.1, 0.01 * np.eye(2))
    (pair,) = result.evidence.findings.pairs
    alone = Fit(members[:1], scaled[:1] - 1.0, 0.8, 0.8, 0.2, 0.2, 0.01 * np.eye(1))
    singles = [*result.evidence.findings.singles, alone]
    findings = replace(result.evidence.findings, singles=singles, pairs=[pair, other])
    verdict = Verdict(
        'porosity', 0.7, pair, ('porosity', 'rate'), ('retardation',), {'porosity': 0.7},
        alternatives=(('retardation', 'rate'),),
    )  # fmt: skip
    return replace(result, verdict=verdict, evidence=replace(result.evidence, findings=findings))


def test_a_found_effect_is_said_with_its_size_and_the_error_that_it_closes(denser):
    found = facts(denser)
    assert (found.named.same, found.unexplained) == ([], None)
    assert found.parameters == [('', 'factor', '0.880', '0.873 … 0.887')]
    errors = found.summary['error']
    assert found.named.improvement == ('maps', errors['before'], errors['after'], None)
    said = found.said('sentence')
    assert said.startswith('**Porosity**: the porosity is 12 % lower than nominal')
    assert EFFECTS['porosity'].also in said  # no effect of the library scales all pumps
    assert '(confidence 90 %). With the correction the error' in said
    assert found.said('how_much').startswith('factor: **0.880** (90 % interval 0.873 … 0.887)\n')


@pytest.mark.parametrize(
    ('name', 'parameters', 'place'),
    [
        ('porosity', {}, ('rig',)),
        ('registration', {}, ('camera',)),
        ('leak', {'x': 0.33, 'z': 0.3}, ('point', (0.33, 0.3))),
        ('rate', {}, ('well', (0.235, 0.235), 'injector')),
        ('well_position', {'dx': 0.01}, ('well', (0.235, 0.235), 'injector', (0.245, 0.235))),
    ],
)
def test_an_effect_acts_at_a_place_or_has_none(denser, name, parameters, place):
    assert facts(naming(denser, name, parameters)).named.common_place == ActingPlace(*place)


def test_numerical_diffusion_is_no_property_of_the_rig(denser):
    name, null = 'numerical_diffusion', denser.evidence.findings.null
    numerics = Numerics('upwind', 9.0, 3.0, model_diffusion=2e-8)
    smearing = replace(denser, evidence=replace(denser.evidence, numerics=numerics))
    found = facts(smearing, name=name, model=null, members=(name,))
    assert found.named.common_place == ActingPlace('model')
    assert found.said('cause') == '**numerical diffusion**, an effect of the model'


def test_an_improvement_may_show_only_with_blur_in_the_fitted_part_or_in_readings(denser):
    assert facts(hidden(denser)).named.improvement.seen_in == 'camera'
    unknown = facts(hidden(denser, level_known=False)).named.improvement
    assert unknown.seen_in == 'camera and level' and unknown.after < unknown.before
    same = hidden(denser, after=denser.held_out[0].before)
    fitted = facts(same).named.improvement
    assert fitted.seen_in == 'fitted part' and fitted.held_out[0] == fitted.held_out[1]
    model = replace(denser.verdict.model, fitted_error=0.9)
    found = facts(replace(same, readings=(READING,)), model=model).named.improvement
    assert found.seen_in == 'readings'
    assert (found.before, found.after) == pytest.approx((4.0, 0.2))


def test_effects_together_or_alike_have_a_place_each(denser):
    pair = facts(denser, model=denser.evidence.findings.pairs[0], members=('porosity', 'rate'))
    alike = facts(denser, inseparable=('rate',))
    for found in (pair, alike):
        assert found.named.common_place is None
        assert [place.well for _, place in found.named.places] == ['', 'control2']
        assert {one.effect for one in found.parameters} == {'porosity', 'rate'}
    assert pair.said('sentence').startswith('**Porosity** and **rate**: the porosity is 12 % lower')
    assert alike.named.same == [('rate',)]
    assert 'or **rate**, which this recording cannot separate' in alike.said('sentence')


def test_effects_that_rig_yaml_describes_already_are_known(denser):
    known = [EffectDescription(name=name, parameters={}) for name in ('porosity', 'decay')]
    assert facts(with_effects(denser, *known)).named.described == ['porosity']


def test_the_nearest_explanation_is_the_one_that_closes_more(denser):
    form = RemainderForm((TERM,), 0.86)
    for closed, nearest in ((0.77, 'form'), (0.9, 'part')):
        found = facts(unexplained(denser, form, closed)).unexplained
        assert (found.nearest, found.says_form) == (nearest, nearest == 'form')
        assert found.is_nearly_known == (closed > 0.8)
    assert facts(unexplained(denser, form)).unexplained.nearest == 'nothing'


def test_an_unexplained_gap_has_a_strongest_place_and_a_best_model(denser):
    found = facts(unexplained(denser)).unexplained
    assert (found.tried, found.spot) == (2, denser.gap.spots[0])
    assert found.fronts_off > 0.0
    assert facts(held_out(unexplained(denser), error_after=1.0)).unexplained.fronts_off is None


@pytest.mark.parametrize(
    ('before', 'is_local', 'leaves_more'),
    [(0.02, True, False), (0.035, False, False), (0.2, False, True)],
)
def test_an_error_may_be_that_of_noise_and_blur(denser, before, is_local, leaves_more):
    found = facts(held_out(no_gap(denser), error_before=before))
    assert (found.is_local, found.leaves_more, found.is_open) == (is_local, leaves_more, False)


def test_a_calibration_takes_a_part_of_an_effect_that_pales_the_core(denser):
    for name, told, pales in (('decay', True, True), ('decay', None, False), ('leak', True, False)):
        found = facts(naming(calibrated(denser, told), name, {}))
        assert found.paling == ([name] if pales else [])


def test_a_misfit_that_shared_errors_take_away_is_told_where_it_makes_a_gap(denser):
    for unshared, told in ((0.9, 0.9), (0.44, 0.0)):
        model = replace(denser.verdict.model, fitted_misfit=0.0, unshared_misfit=(unshared, 0.0))
        assert facts(denser, model=model).swallowed == told
        assert facts(unexplained(denser), model=model).swallowed == 0.0


def test_beliefs_that_are_nearly_as_strong_as_the_strongest_are_named(denser):
    belief = {'porosity': 0.495, 'retardation': 0.4949, 'rate': 0.01}
    found = answer_of(denser, diagnosis_json(denser) | {'belief': belief})
    assert found.believed == ['porosity', 'retardation']
    assert '**porosity or retardation** (50 % each)' in found.said('how_sure')


def test_effects_of_an_inseparable_pair_have_the_sizes_of_their_joint_fit(denser):
    found = facts(inseparable_pairs(denser))
    (row,) = (row for row in found.summary['effects'] if row['name'] == 'retardation')
    ((sorbed, pump),) = found.named.alternatives
    assert (sorbed['name'], pump['name']) == ('retardation', 'rate')
    assert sorbed['parameters'] == row['parameters']
    factor = sorbed['parameters']['retardation_factor']
    assert factor['value'] == pytest.approx(1.15)
    assert factor['low'] < 1.15 < factor['high']
    assert {'well', 'factor'} <= set(pump['parameters'])
    assert '; or the tracer sorbs to the sand and travels at 87 %' in found.said('sentence')


def test_every_answer_is_said_in_whole_sentences(denser):
    model = replace(denser.verdict.model, fitted_error=0.9, unshared_misfit=(9.0, 9.0))
    same = replace(hidden(denser, after=denser.held_out[0].before), readings=(READING,))
    untried = replace(denser.evidence.findings, untried='pairs of effects')
    scant = replace(denser.evidence, cells_along=47, fitted_frames=3, findings=untried)
    spot, weak = Spot(0.31, 0.22, 0.05, 0.4), RemainderForm((TERM,), 0.4)
    for found in (
        facts(twice(denser), close=('rate',)),
        facts(with_effects(denser, EffectDescription(name='porosity', parameters={}))),
        facts(inseparable_pairs(denser)),
        facts(hidden(denser)),
        facts(same, model=model),
        facts(calibrated(no_gap(denser)), confidence=0.5),
        facts(replace(denser, evidence=scant)),
        facts(replace(unexplained(denser, weak), gap=replace(denser.gap, spots=()))),
        facts(unexplained(denser, RemainderForm((), 0.0), 0.9, spot=spot, rest=0.4)),
        facts(unexplained(denser, weak, 0.5, spot=spot)),
        facts(held_out(unexplained(denser, weak, 0.3, rest=0.6), error_before=0.02)),
    ):
        for part in ('sentence', 'cause', 'where', 'how_much', 'how_sure'):
            said = found.said(part)
            assert re.search(r'  | [.,;:)]|\( |\.\.|[{}]|^$', said) is None, said
