"""The first screen of the report: cause, where, how much, how sure."""

import re
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_results import naming

from porotwin_diagnosis.advice.partial_cause import PartialCause
from porotwin_diagnosis.advice.remainder_form import RemainderForm, Term
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.report.answer import answer, sentence
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_recording.tables.concentration import MapOrigin
from porotwin_solver.effects import EFFECTS


def said(result, verdict=None):
    changed = result if verdict is None else replace(result, verdict=verdict)
    return sentence(changed, diagnosis_json(changed))


def rows(result):
    """Return the rows of the answer as plain text, by their names."""
    found = answer(result, diagnosis_json(result))
    return {name: ' '.join(lines).replace('**', '') for name, lines in found}


def test_a_found_effect_is_said_with_the_error_that_it_closes(denser):
    text = said(denser)
    assert text.startswith('**Porosity**: the porosity is 12 % lower than nominal')
    assert EFFECTS['porosity'].also in text  # no effect of the library scales all pumps
    assert 'confidence 90 %' in text
    assert 'of the gap is closed' in text


def test_the_first_screen_names_cause_place_size_and_confidence(denser):
    found = rows(denser)
    assert list(found) == ['Cause', 'Where', 'How much', 'How sure']
    assert found['Cause'] == 'porosity, an effect of the rig'
    assert found['How much'].startswith('factor: 0.880 (90 % interval 0.873 … 0.887)')
    assert found['Where'] == 'In the whole rig.'
    assert '90 %' in found['How sure']


@pytest.mark.parametrize(
    ('name', 'parameters', 'place'),
    [
        ('registration', {'dx': 0.004}, 'Nowhere in the rig: this is an effect of the camera'),
        ('clock', {'offset': -60.0}, 'Nowhere in the rig: this is an effect of the camera'),
        ('leak', {'x': 0.33, 'z': 0.3, 'rate': -20.0}, 'At x = 0.330 m, z = 0.300 m'),
        ('rate', {'factor': 0.9}, 'At the well injector, x = 0.235 m, z = 0.235 m.'),
        (
            'well_position',
            {'dx': 0.01, 'dz': -0.004},
            'At the well injector, x = 0.235 m, z = 0.235 m by rig.yaml; '
            'it opens at x = 0.245 m, z = 0.231 m.',
        ),
    ],
)
def test_the_place_of_an_effect_is_said_or_that_it_has_none(denser, name, parameters, place):
    assert rows(naming(denser, name, parameters))['Where'].startswith(place)


def test_numerical_diffusion_is_no_property_of_the_rig(denser):
    numerics = Numerics('upwind', 9.0, 3.0, model_diffusion=2e-8)
    verdict = replace(
        denser.verdict,
        name='numerical_diffusion',
        model=denser.evidence.findings.null,
        members=('numerical_diffusion',),
    )
    result = replace(denser, verdict=verdict, evidence=replace(denser.evidence, numerics=numerics))
    assert rows(result)['Cause'] == 'numerical diffusion, an effect of the model'
    assert rows(result)['Where'] == 'In the model, at every front.'


def test_an_improvement_that_shows_only_beside_blurred_fronts_is_said(denser):
    (part,) = denser.held_out
    hidden = replace(part, error_after=part.error_before + 0.01)
    text = said(replace(denser, held_out=(hidden,)))
    assert 'and with the blur of the camera, the error' in text
    nothing = replace(hidden, after=part.before)
    text = said(replace(denser, held_out=(nothing,)))
    assert 'The gap lies in the part before' in text


def test_both_members_of_a_pair_are_said(denser):
    pair = denser.evidence.findings.pairs[0]
    verdict = Verdict('porosity', 0.8, pair, ('porosity', 'rate'), (), {'porosity': 1.0})
    text = said(denser, verdict)
    assert text.startswith('**Porosity** and **rate**: the porosity is 12 % lower')
    assert 'delivers' in text
    where = rows(replace(denser, verdict=verdict))['Where']
    assert where.startswith('porosity: In the whole rig. rate: At the well control2, x = 0.500 m')


def test_effects_that_look_the_same_are_said(denser):
    verdict = replace(denser.verdict, inseparable=('rate',))
    assert 'or **rate**, which this recording cannot separate' in said(denser, verdict)
    found = rows(replace(denser, verdict=verdict))
    assert 'cannot separate porosity from rate' in found['How sure']
    assert 'or rate' in found['Cause']


def test_no_gap_is_said_with_the_error_that_noise_makes(denser):
    verdict = Verdict('none', 0.9, denser.evidence.findings.null, (), (), {'porosity': 0.1})
    text = said(denser, verdict)
    assert text.startswith('**No gap** (confidence')
    assert 'no larger than the errors that a solver and a calibration leave' in text
    assert said(denser, replace(verdict, confidence=0.5)).startswith('**No gap, but this is unsu')
    (part,) = denser.held_out
    good = replace(denser, held_out=(replace(part, error_before=part.noise_floor),))
    assert 'a solver and a calibration' not in said(good, verdict)
    assert rows(replace(denser, verdict=verdict))['Where'] == 'Nowhere.'


def test_a_form_that_closes_more_than_known_effects_is_said(denser):
    pair = denser.evidence.findings.pairs[0]
    verdict = Verdict('unexplained', 0.9, pair, (), (), {'porosity': 0.1})
    term = Term('level', 'camera', -0.1, '-', 'the plume is 10 % paler throughout', 'dilute it')
    part = PartialCause(pair, 0.77, RemainderForm((), 0.0), None)
    form = RemainderForm((term,), 0.86)
    result = replace(denser, verdict=verdict, partial=part, remainder=form)
    assert 'the plume is 10 % paler throughout. This closes 86 % of it' in said(result)


def test_before_a_form_that_closes_less_than_half_it_is_said_that_none_fits_well(denser):
    pair = denser.evidence.findings.pairs[0]
    verdict = Verdict('unexplained', 0.9, pair, (), (), {'porosity': 0.1})
    term = Term('level', 'camera', -0.1, '-', 'the plume is 10 % paler throughout', 'dilute it')
    result = replace(denser, verdict=verdict, remainder=RemainderForm((term,), 0.44))
    cause = rows(result)['Cause']
    assert 'No form that was found fits well. The best one looks like the camera: the' in cause
    well = replace(result, remainder=RemainderForm((term,), 0.5))
    assert 'It looks most like the camera: the plume' in rows(well)['Cause']


def test_an_unexplained_gap_is_said_with_its_size_and_its_strongest_place(denser):
    worst = denser.evidence.findings.singles[1]
    verdict = Verdict('unexplained', 0.9, worst, (), (), {'porosity': 0.1})
    text = said(denser, verdict)
    assert text.startswith('**Unexplained** (confidence 90 %). There is a gap: the error')
    assert 'None of the 2 tried effects, and none of their best combinations' in text
    assert 'as if fronts were' in text and 'mm off' in text
    (part,) = denser.held_out
    lost = replace(denser, held_out=(replace(part, error_before=0.9, error_after=1.0),))
    assert 'held-out part is 100.0 %' in said(lost, verdict)
    assert 'as if fronts' not in said(lost, verdict)
    assert rows(replace(denser, verdict=verdict))['Where'].startswith('Most of all near x = ')


@pytest.mark.parametrize('calibrated', [True, None])
@pytest.mark.parametrize(
    ('name', 'parameters', 'hidden'),
    [('decay', {'rate': 1e-4}, True), ('porosity', {'factor': 0.88}, False)],
)
def test_a_calibration_that_hides_a_part_of_an_effect_is_said(
    denser, name, parameters, hidden, calibrated
):
    (recording,) = denser.recordings
    maps = replace(recording.maps, origin=MapOrigin(calibrated))
    seen = replace(denser, recordings=(replace(recording, maps=maps),))
    text = rows(naming(seen, name, parameters))['How sure']
    assert ('is a lower bound' in text) is (hidden and calibrated is True)


def test_a_scant_recording_is_said_to_limit_the_confidence(denser):
    scant = replace(denser, evidence=replace(denser.evidence, cells_along=47))
    assert 'more than 60 % here: maps of 47 cells along' in rows(scant)['How sure']
    assert 'coarser than the 80' in rows(scant)['How sure']
    assert 'No answer gets more' not in rows(denser)['How sure']


def test_effects_of_an_inseparable_pair_have_the_sizes_of_their_joint_fit(denser):
    sample = denser.samples[0]
    known = {candidate.effect: candidate for candidate in library([sample])}
    members = (known['retardation'], known['rate'])
    scaled = np.array([members[0].parameters[0].scaled(1.15), 0.5])
    other = Fit(members, scaled, 0.5, 0.5, 0.1, 0.1, 0.01 * np.eye(2))
    (pair,) = denser.evidence.findings.pairs
    alone = Fit(members[:1], scaled[:1] - 1.0, 0.8, 0.8, 0.2, 0.2, 0.01 * np.eye(1))
    singles = [*denser.evidence.findings.singles, alone]
    findings = replace(denser.evidence.findings, singles=singles, pairs=[pair, other])
    verdict = Verdict(
        'porosity', 0.7, pair, ('porosity', 'rate'), ('retardation',), {'porosity': 0.7},
        alternatives=(('retardation', 'rate'),),
    )  # fmt: skip
    result = replace(denser, verdict=verdict, evidence=replace(denser.evidence, findings=findings))
    rows = {row['name']: row['parameters'] for row in diagnosis_json(result)['effects']}
    factor = rows['retardation']['retardation_factor']
    assert factor['value'] == pytest.approx(1.15)
    assert factor['low'] < 1.15 < factor['high']
    assert '; or the tracer sorbs to the sand and travels at 87 % of' in said(result)
    assert re.search('87 % of the water.s speed, and pump .* delivers', said(result))
    ((sorbed, pump),) = diagnosis_json(result)['alternative_effects']
    assert (sorbed['name'], pump['name']) == ('retardation', 'rate')
    assert sorbed['parameters'] == rows['retardation']
    assert {'well', 'factor'} <= set(pump['parameters'])
