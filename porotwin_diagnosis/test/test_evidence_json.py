"""Evidence as a file: the verdict can be decided again from it."""

from dataclasses import replace

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.report.evidence_json import read_evidence, write_evidence
from porotwin_diagnosis.search.findings import Findings


def evidence():
    """Return the evidence of a pair: a wrong rate and a nonlinear response."""
    noise = (0.4, 0.4)
    null = fit_of(misfit=6.0, noise=noise)
    singles = [
        fit_of('rate', misfit=1.6, noise=noise),
        fit_of('saturation', misfit=4.0, noise=noise),
    ]
    found = Findings(
        null,
        null,
        singles,
        singles,
        [fit_of('saturation', 'rate', misfit=0.5, noise=noise)],
        [0.0, 3.0],
        [0.0],
        [fit_of('saturation', misfit=5.0, error=4.0), fit_of('rate', misfit=5.0, error=1.7)],
        [1.0, 1.0],
    )
    numerics = Numerics('upwind', 9.0, 6.0, with_effects=5.0, model_diffusion=1e-8)
    return Evidence(found, explain(found), numerics, (0.2, 0.05), 94, 20)


@pytest.mark.parametrize(
    'changes', [{}, {'cells_along': 60}, {'held_out_errors': (0.05, 0.2)}, {'fitted_frames': 2}]
)
def test_a_verdict_can_be_decided_again_from_the_file(tmp_path, changes):
    before = replace(evidence(), **changes)
    write_evidence(tmp_path / 'findings.json', before)
    first, second = decide(before), decide(read_evidence(tmp_path / 'findings.json'))
    assert (second.name, second.members) == (first.name, first.members)
    assert second.confidence == pytest.approx(first.confidence)
    assert second.probabilities == pytest.approx(first.probabilities)


def test_an_open_clock_is_kept(tmp_path):
    write_evidence(tmp_path / 'findings.json', replace(evidence(), may_have_held_tracer=True))
    assert read_evidence(tmp_path / 'findings.json').may_have_held_tracer


def test_the_pair_is_named_with_the_numerical_diffusion(tmp_path):
    write_evidence(tmp_path / 'findings.json', evidence())
    verdict = decide(read_evidence(tmp_path / 'findings.json'))
    assert verdict.name == 'rate'
    assert verdict.members == ('rate', 'saturation', 'numerical_diffusion')
