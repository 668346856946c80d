"""The report page: every verdict in one sentence, every effect in words, pictures of each."""

import io
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import recorded
from matplotlib.image import imsave

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.examine import Diagnosis
from porotwin_diagnosis.model.candidate import library
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.gap_map import map_gap
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.report.figures import error_course
from porotwin_diagnosis.report.page import sentence, write_report
from porotwin_diagnosis.report.wording import CHECKS, PHRASES, interval, number, phrase, value
from porotwin_diagnosis.search.findings import Findings
from porotwin_recording.photos import Photo
from porotwin_recording.recording import open_recording


@pytest.fixture(scope='module')
def denser(tmp_path_factory):
    """The diagnosis of a lower porosity, with the true effect as if found, and nothing searched."""
    effect = EffectDescription(name='porosity', parameters={'factor': 0.88})
    recording = open_recording(recorded(tmp_path_factory.mktemp('denser') / 'recording', effect))
    sample = read_sample(recording)
    candidates = {candidate.effect: candidate for candidate in library([sample])}
    fitter = Fitter([Forward(sample)])
    porosity, rate = candidates['porosity'], candidates['rate']
    found = np.array([porosity.parameters[0].scaled(0.88)])
    null = fitter.evaluate((), np.zeros(0))
    best = replace(fitter.evaluate((porosity,), found), covariance=np.array([[0.04]]))
    other = fitter.evaluate((rate,), np.array([1.0]))
    pair = fitter.evaluate((porosity, rate), np.array([found[0], 0.5]))
    singles = [best, other]
    distances = [0.0, 3.0]
    findings = Findings(null, null, singles, singles, [pair], distances, runs=4)
    late = recording.times >= sample.held_out_start
    observed = recording.concentration[late].astype(float)
    part = replace(sample, times=recording.times[late], observed=observed, fitted_frames=0)
    before = Forward(part).maps(())
    after = Forward(part).maps(best.effects)
    errors = (part.relative_error(before), part.relative_error(after))
    verdict = Verdict('porosity', 0.9, best, ('porosity',), (), {'porosity': 0.98, 'rate': 0.02})
    result = Diagnosis(
        (recording,),
        (sample,),
        findings,
        verdict,
        (HeldOut(part.times, observed, before, after, *errors, 0.03),),
        map_gap(recording),
        Numerics('accurate', null.held_out_misfit, null.held_out_misfit),
        {'porosity': {'parameter': 'factor', 'value': 0.0097, 'unit': '-'}},
        (),
        {},
    )
    return replace(result, summary=diagnosis_json(result))


def said(result, verdict):
    changed = replace(result, verdict=verdict)
    return replace(changed, summary=diagnosis_json(changed))


def page(result, folder):
    write_report(folder / 'report.html', result)
    text = (folder / 'report.html').read_text(encoding='utf-8')
    return text, text.split('<p class="verdict">')[1].split('</p>')[0]


def test_a_found_effect_is_said_in_words_with_its_interval(denser, tmp_path):
    text, verdict_said = page(denser, tmp_path)
    assert verdict_said.startswith('<b>Porosity</b>: the porosity is 12 % lower than believed')
    assert 'confidence 90 %' in verdict_said
    assert text.count('data:image/png;base64,') == 3
    assert '0.873 … 0.887' in text
    assert 'weigh the water that fills the rig' in text


def test_what_shows_only_beside_soft_fronts_is_said_of_soft_fronts(denser):
    (part,) = denser.held_out
    hidden = replace(part, error_after=part.error_before + 0.01)
    text = sentence(said(replace(denser, held_out=(hidden,)), denser.verdict))
    assert 'with fronts as soft as the camera shows them' in text
    assert 'of the gap is closed' in sentence(denser)
    nothing = replace(hidden, after=part.before)
    text = sentence(said(replace(denser, held_out=(nothing,)), denser.verdict))
    assert 'The gap lies in the part before' in text


def test_both_members_of_a_pair_are_said(denser):
    pair = denser.findings.pairs[0]
    verdict = Verdict('porosity', 0.8, pair, ('porosity', 'rate'), (), {'porosity': 1.0})
    text = sentence(said(denser, verdict))
    assert text.startswith('<b>Porosity</b> and <b>rate</b>: the porosity is 12 % lower')
    assert 'delivers' in text


def test_effects_that_show_the_same_are_said_to(denser):
    verdict = replace(denser.verdict, inseparable=('rate',))
    text = sentence(said(denser, verdict))
    assert 'or <b>rate</b>, which this recording cannot tell apart' in text


def test_no_gap_says_what_could_not_have_been_seen_first(denser, tmp_path):
    verdict = Verdict('none', 0.9, denser.findings.null, (), (), {'porosity': 0.1})
    text, verdict_said = page(said(denser, verdict), tmp_path)
    assert verdict_said.startswith('<b>No gap.</b>')
    assert 'Next experiment' not in text
    assert text.index('could not have shown') < text.index('What was tried')
    assert '0.97 %' in text


def test_an_unexplained_gap_is_said_with_its_size_and_the_remainder_drawn(denser, tmp_path):
    verdict = Verdict('unexplained', 0.9, denser.findings.singles[1], (), (), {'porosity': 0.1})
    text, verdict_said = page(said(denser, verdict), tmp_path)
    assert verdict_said.startswith('<b>Unexplained.</b> There is a gap: the model misses')
    assert 'None of the 2 effects of the library, nor of their best pairs' in verdict_said
    assert 'mm off would leave' in verdict_said
    assert text.count('data:image/png;base64,') == 4
    assert 'The remainder' in text


def test_of_several_recordings_each_has_its_errors_and_its_course(denser, tmp_path):
    twice = replace(
        denser,
        recordings=denser.recordings * 2,
        samples=denser.samples * 2,
        held_out=denser.held_out * 2,
    )
    text, _ = page(replace(twice, summary=diagnosis_json(twice)), tmp_path)
    assert text.count('data:image/png;base64,') == 5
    assert '<th class="n">gap closed</th>' in text


def test_the_last_photograph_comes_first_and_a_broken_one_is_left_out(denser, tmp_path):
    buffer = io.BytesIO()
    imsave(buffer, np.zeros((90, 160, 3), dtype=np.uint8), format='jpg')
    good = Photo(60.0, 'state', 'a.jpg', buffer.getvalue)
    broken = Photo(60.0, 'state', 'b.jpg', lambda: b'no photograph')
    for photo, pictures in ((good, 1), (broken, 0)):
        recording = replace(denser.recordings[0], photos=(photo,))
        text, _ = page(replace(denser, recordings=(recording,)), tmp_path)
        assert text.count('data:image/jpeg;base64,') == pictures


def test_error_falls_in_the_fitted_and_in_the_held_out_part(denser):
    course = error_course(denser)
    sample = denser.samples[0]
    fitted = course.times < course.held_out_start
    assert course.held_out_start == sample.held_out_start
    for part in (fitted, ~fitted):
        assert np.mean(course.after[part]) < 0.6 * np.mean(course.before[part])
    assert np.all(course.floor > 0)


def test_every_effect_of_the_library_has_words_and_a_check(denser):
    for candidate in library(denser.samples):
        parameters = {
            name: {'value': amount}
            for name, amount in candidate.described(candidate.first).parameters.items()
        }
        assert phrase(candidate.effect, parameters)
        assert candidate.effect in CHECKS
    assert set(PHRASES) == set(CHECKS)


def test_parameters_are_read_in_units_of_the_bench():
    assert value('rate', 1e-5, '1/s') == '3.6 %/h'
    assert value('dx', -0.0051, 'm') == '−5.1 mm'
    assert number(1.4e-8, 2) == '1.4·10<sup>−8</sup>'
    assert number(1234.0, 2) == '1200'
    parameter = {'value': 0.0494, 'low': 0.0471, 'high': 0.0518, 'unit': 'm'}
    assert interval('radius', parameter) == ('49.4 mm', '47.1 … 51.8 mm')
    assert interval('well', {'value': 'a<b'}) == ('a&lt;b', '')


def test_directions_follow_the_sign():
    assert 'lighter' in phrase('buoyancy', {'density_difference': {'value': -0.4}})
    assert '18 s earlier' in phrase('clock', {'offset': {'value': -18.0}})
    lost = phrase('leak', {'x': {'value': 0.1}, 'z': {'value': 0.2}, 'rate': {'value': -20.0}})
    assert lost.startswith('water is lost at x = 0.100 m, z = 0.200 m: 20 ml/h')
