"""The templates of the report: their line breaks, the words for a doubt, and the captions."""

from dataclasses import replace

import pytest
from diagnosis_results import naming, no_gap, twice
from jinja2 import DictLoader, UndefinedError

from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED, Doubt
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.report.page import caption
from porotwin_diagnosis.report.templates import TEMPLATES, said


def test_line_breaks_are_spaces_and_marks_begin_lines(monkeypatch):
    text = '\n- one {{ name }},\n  and\n{% if more %}\n- two\n{% endif %}'
    macro = f'{{% macro told() %}}{text}{{% endmacro %}}'
    monkeypatch.setattr(TEMPLATES, 'loader', DictLoader({'t.txt.j2': macro}))
    assert said('t.txt.j2', 'told', {'name': '<b> - c', 'more': True}) == 'one <b> - c, and\ntwo'
    with pytest.raises(UndefinedError, match='more'):
        said('t.txt.j2', 'told', {'name': 'b'})


def doubt(result, **changes):
    return diagnosis_json(replace(result, verdict=replace(result.verdict, **changes)))['doubt']


def test_every_doubt_has_its_words(denser):
    findings = replace(denser.evidence.findings, untried='pairs')
    few = replace(denser.evidence, cells_along=47, fitted_frames=3, findings=findings)
    said = {doubt(replace(denser, evidence=few), doubt=one) for one in Doubt}
    said |= {doubt(denser, doubt=Doubt.RIVAL, rival=one) for one in ((NONE,), ('leak', 'rate'))}
    said |= {doubt(denser, doubt=Doubt.CALIBRATION, name=NONE)}
    said |= {doubt(denser, doubt=Doubt.REMAINDER, name=UNEXPLAINED)}
    assert len(said - {''}) == len(Doubt) + 4
    assert 'whether the cause is leak and rate instead, the next best explanation' in said


@pytest.mark.parametrize(('cells_along', 'fitted_frames'), [(79, 4), (80, 3), (80, 4)])
def test_a_scant_recording_is_coarse_or_has_few_maps(denser, cells_along, fitted_frames):
    few = replace(denser.evidence, cells_along=cells_along, fitted_frames=fitted_frames)
    assert (few.is_coarse, few.has_few_frames) == (cells_along < 80, fitted_frames < 4)
    assert few.scant == bool(doubt(replace(denser, evidence=few), doubt=Doubt.SCANT))


def test_captions_fit_the_verdict_and_the_recording(denser):
    none, clock, leak = no_gap(denser), naming(denser, 'clock', {}), naming(denser, 'leak', {})
    assert len({caption(one, 'gap', 0) for one in (denser, none, clock, leak)}) == 4
    assert len({caption(one, 'plumes', 0) for one in (denser, none, twice(denser))}) == 3
    assert len({caption(one, 'where', 0) for one in (denser, leak, twice(denser))}) == 3
    assert '(porosity)' in caption(denser, 'remainder', 0)
    assert caption(twice(denser), 'course', 1).startswith('Error over time (recording). The model')
