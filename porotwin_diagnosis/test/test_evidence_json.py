"""Evidence as a file: the verdict can be decided again from it."""

from dataclasses import replace

import pytest
from diagnosis_examples import pair_evidence

from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.report.evidence_json import read_evidence, write_evidence


@pytest.mark.parametrize('changes', [{}, {'cells_along': 60}, {'fitted_frames': 2}])
def test_a_verdict_can_be_decided_again_from_the_file(tmp_path, changes):
    before = replace(pair_evidence(), **changes)
    write_evidence(tmp_path / 'findings.json', before)
    first, second = decide(before), decide(read_evidence(tmp_path / 'findings.json'))
    assert (second.name, second.members) == (first.name, first.members)
    assert second.confidence == pytest.approx(first.confidence)
    assert second.probabilities == pytest.approx(first.probabilities)


def test_an_open_clock_is_kept(tmp_path):
    write_evidence(tmp_path / 'findings.json', replace(pair_evidence(), may_have_held_tracer=True))
    assert read_evidence(tmp_path / 'findings.json').may_have_held_tracer


def test_the_pair_is_named_with_the_numerical_diffusion(tmp_path):
    write_evidence(tmp_path / 'findings.json', pair_evidence())
    verdict = decide(read_evidence(tmp_path / 'findings.json'))
    assert verdict.name == 'rate'
    assert verdict.members == ('rate', 'saturation', 'numerical_diffusion')
