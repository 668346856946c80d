"""When evidence is scant, and when the held-out maps contradict an explanation."""

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.search.findings import Findings


def evidence(errors=(0.2, 0.05), columns=94, frames=20):
    null = fit_of(misfit=5.0)
    findings = Findings(null, null, [], [fit_of('decay', misfit=0.4)], distances=[0.0])
    numerics = Numerics('accurate', 5.0, 5.0)
    return Evidence(findings, explain(findings), numerics, errors, columns, frames)


def test_an_effect_with_which_the_error_grows_is_contradicted():
    assert evidence((0.10, 0.11)).contradicted
    assert not evidence((0.20, 0.05)).contradicted


def test_an_effect_that_changes_nothing_in_the_held_out_part_is_not_contradicted():
    """A late clock, if the pumps rest at last: its gap arose before."""
    assert not evidence((0.1000, 0.1008)).contradicted


@pytest.mark.parametrize(('columns', 'frames'), [(79, 20), (94, 3)])
def test_large_cells_and_few_frames_are_scant(columns, frames):
    assert evidence(columns=columns, frames=frames).scant
    assert not evidence(columns=80, frames=4).scant
