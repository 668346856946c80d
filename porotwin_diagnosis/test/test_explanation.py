"""The model that is kept: as few effects as explain the recording."""

from dataclasses import replace

import pytest
from diagnosis_examples import fit_of

from porotwin_diagnosis.decision.explanation import explain, kept_model
from porotwin_diagnosis.search.findings import Findings


def findings(null, singles, pairs=()):
    fits = [fit_of(name, misfit=value) for name, value in singles]
    both = [fit_of(*names, misfit=value) for names, value in pairs]
    without = fit_of(misfit=null)
    return Findings(without, without, fits, fits, both, [0.0] * len(fits), [0.0] * len(both))


@pytest.mark.parametrize(
    ('null', 'single', 'pair', 'kept'),
    [
        (0.4, 0.3, 0.2, 'none'),
        (0.5, 0.45, 0.42, 'none'),  # nothing helps
        (0.5, 0.35, 0.3, 'rate'),
        (0.6, 0.55, 0.52, 'rate'),
        (0.54, 0.52, 0.5, 'none'),  # the effect helps so little that none is more probable
        (6.0, 0.5, 0.1, 'rate'),  # it suffices
        (6.0, 2.0, 0.5, 'rate + decay'),
        (6.0, 2.0, 1.7, 'rate'),
    ],
)
def test_a_second_effect_is_kept_only_if_one_does_not_suffice_and_it_helps(
    null, single, pair, kept
):
    found = findings(null, [('rate', single)], [(('rate', 'decay'), pair)])
    assert kept_model(found).label == kept


def test_a_triple_is_kept_although_no_pair_is_better_than_its_best_member():
    found = findings(6.0, [('rate', 2.0)], [(('rate', 'decay'), 2.1)])
    triple = fit_of('rate', 'decay', 'clock', misfit=0.4)
    assert kept_model(replace(found, triples=[triple])).label == 'rate + decay + clock'
    worse = fit_of('rate', 'decay', 'clock', misfit=1.4)  # 0.64 of 2 is 1.28
    assert kept_model(replace(found, triples=[worse])).label == 'rate'


def test_a_model_that_does_not_suffice_names_nothing():
    explanation = explain(findings(6.0, [('rate', 4.0), ('clock', 4.0)]))
    assert not explanation.suffices
    assert explanation.model.label == 'rate'
    assert explanation.members == explanation.inseparable == ()
