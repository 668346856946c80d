"""When evidence is scant."""

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.search.findings import Findings


def evidence(cells_along=94, frames=20):
    null = fit_of(misfit=5.0)
    findings = Findings(null, null, [], [fit_of('decay', misfit=0.4)], distances=[0.0])
    numerics = Numerics('accurate', 5.0, 5.0)
    return Evidence(findings, explain(findings), numerics, cells_along, frames)


@pytest.mark.parametrize(('cells_along', 'frames'), [(79, 20), (94, 3)])
def test_large_cells_and_few_frames_are_scant(cells_along, frames):
    assert evidence(cells_along=cells_along, frames=frames).scant
    assert not evidence(cells_along=80, frames=4).scant
