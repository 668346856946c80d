"""Effects that close much of an unexplained gap are told together with the rest of the gap."""

from dataclasses import replace

import pytest

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.partial_cause import is_dipole, partial_cause
from porotwin_diagnosis.advice.remainder_form import RemainderForm, Term
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.gap_map import Spot
from porotwin_diagnosis.report.answer import answer_of
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.search.levels import make_levels


@pytest.fixture(scope='module')
def part(denser):
    """The share of a gap that the porosity closes, as if it did not suffice."""
    levels = make_levels(denser.samples, progress=lambda _stage, _share: None)
    return partial_cause(denser.recordings, levels, denser.verdict.model, denser.held_out)


def test_the_effects_are_kept_with_the_form_beside_them(denser, part):
    assert part.model is denser.verdict.model
    assert part.closed > 0.5
    assert part.form.closed < 0.5  # the porosity was right: hardly anything has a form


def test_effects_that_close_too_little_are_not_told(denser):
    levels = make_levels(denser.samples, progress=lambda _stage, _share: None)
    (held_out,) = denser.held_out
    useless = replace(held_out, after=held_out.before, error_after=held_out.error_before)
    null, model = denser.evidence.findings.null, denser.verdict.model
    assert partial_cause(denser.recordings, levels, null, denser.held_out) is None
    assert partial_cause(denser.recordings, levels, model, [useless]) is None
    assert levels.simulations == 0


def test_the_answer_and_the_file_hold_the_effects_and_the_place_of_the_rest(denser, part):
    term = Term('source', 'source', 1e-4, 'm2', 'water enters near x = 0.30 m', 'look', (0.3, 0.2))
    part = replace(part, form=RemainderForm((term,), 0.6), spot=Spot(0.31, 0.22, 0.05, 0.4))
    verdict = Verdict('unexplained', 0.9, part.model, (), (), {'porosity': 0.1})
    result = replace(denser, verdict=verdict, remainder=RemainderForm((), 0.1), partial=part)
    summary = diagnosis_json(result)
    beside = summary['remainder']['beside']
    assert [row['name'] for row in beside['effects']] == ['porosity']
    assert beside['effects'][0]['parameters']['factor']['value'] == pytest.approx(0.88)
    assert (beside['kind'], beside['place']['x_m']) == ('source', 0.31)
    found = answer_of(result, summary).unexplained
    assert (found.part, found.nearest) == (beside, 'part')
    assert found.part_fits and not found.is_dipole
    assert summary['combination'] == []


def leak(x, rate):
    return EffectDescription(name='leak', parameters={'x': x, 'z': 0.3, 'rate': rate})


def test_a_source_beside_an_equally_strong_sink_acts_like_other_sand():
    assert is_dipole([leak(0.27, 260.0), leak(0.31, -240.0)], 0.934)
    assert not is_dipole([leak(0.27, 260.0), leak(0.31, 240.0)], 0.934)
    assert not is_dipole([leak(0.27, 260.0), leak(0.31, -40.0)], 0.934)
    assert not is_dipole([leak(0.27, 260.0), leak(0.71, -240.0)], 0.934)
    assert not is_dipole([leak(0.27, 260.0)], 0.934)
