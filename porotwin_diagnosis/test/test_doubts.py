"""Tests of the words for the least certain point of a verdict."""

from dataclasses import replace

import pytest

from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED, Doubt
from porotwin_diagnosis.report.doubts import doubt_words


def words(result, **changes):
    return doubt_words(replace(result, verdict=replace(result.verdict, **changes)))


@pytest.mark.parametrize('doubt', list(Doubt))
def test_every_doubt_has_words(denser, doubt):
    few = replace(denser, evidence=replace(denser.evidence, cells_along=47, fitted_frames=3))
    assert words(few, doubt=doubt)


def test_the_next_best_explanation_is_named(denser):
    rival = words(denser, doubt=Doubt.RIVAL, rival=('dual_porosity', 'leak'))
    assert rival == 'whether the cause is dual porosity and leak instead, the next best explanation'
    assert 'a gap at all' in words(denser, doubt=Doubt.RIVAL, rival=(NONE,))
    assert 'another effect' in words(denser, doubt=Doubt.RIVAL, rival=())


def test_errors_of_the_calibration_hide_a_gap_or_make_one(denser):
    assert 'make the gap' in words(denser, doubt=Doubt.CALIBRATION)
    assert 'hide a gap' in words(denser, doubt=Doubt.CALIBRATION, name=NONE)


def test_the_remainder_of_an_unexplained_gap_is_compared_with_the_one_of_a_true_effect(denser):
    evidence = replace(
        denser.evidence, explanation=replace(denser.evidence.explanation, lack_of_fit=2.34)
    )
    unsure = replace(denser, evidence=evidence)
    assert '2.3 times as much' in words(unsure, doubt=Doubt.REMAINDER, name=UNEXPLAINED)
    assert '234 %' in words(unsure, doubt=Doubt.REMAINDER)
