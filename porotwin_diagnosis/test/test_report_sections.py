"""The rows of the tables of the report."""

from dataclasses import replace

from porotwin_diagnosis.report import report_sections as sections
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json


def test_tried_effects_are_the_named_one_and_those_without_a_sign(denser):
    summary = diagnosis_json(denser)
    named, other = sections.tried_effects(denser, summary)
    assert (named.row['name'], named.is_named, named.has_sign) == ('porosity', True, True)
    assert (other.row['name'], other.is_named, other.has_sign) == ('rate', False, False)
    assert named.bar < other.bar
    first, pair = sections.tried_sets(denser, summary)
    assert (first.label, pair.label) == ('porosity', 'porosity + rate control2')
    assert first.error == summary['error']['after']
    without = sections.effects_without_row(replace(denser, excluded=('clock',)), summary)
    assert 'leak' in without
    assert not {'clock', 'porosity', 'wave'} & set(without)
