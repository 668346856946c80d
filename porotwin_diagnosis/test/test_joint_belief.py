"""Tests of the belief about a rig, and of the prior of the next diagnosis."""

import pytest
from history_examples import TUESDAY, cause, finding, pump, value

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.history.joint_belief import courses, prior_from, weighted


def test_the_belief_is_the_mean_by_precision_and_narrower_than_each():
    (course,) = courses([pump(0.7, width=0.02), pump(0.71, TUESDAY, width=0.04)])
    believed = course.believed()['factor']
    assert believed.value == pytest.approx((4 * 0.7 + 0.71) / 5)
    assert believed.high - believed.low < 0.02


def test_findings_that_scatter_widen_the_belief():
    close = weighted([value(1.0), value(1.01)])
    apart = weighted([value(1.0), value(1.2)] * 50)
    assert close.deviation < value(1.0).deviation
    assert apart.deviation == pytest.approx(0.1 / 10, rel=0.02)


def test_a_vanishing_interval_is_an_exact_value():
    exact = value(0.0).model_copy(update={'low': 0.0, 'high': 1e-300})
    assert weighted([exact, value(0.0)]).value == 0.0


def leaks(*places, date):
    return finding(
        *(cause('leak', x=value(x), z=value(0.2), rate=value(rate)) for x, rate in places),
        date=date,
    )


def test_two_leaks_are_followed_by_their_places():
    monday = leaks((0.2, 10.0), (0.7, 30.0), date='2026-11-23')
    tuesday = leaks((0.69, 31.0), (0.21, 11.0), date=TUESDAY)
    one, other = courses([monday, tuesday])
    assert [c.values['rate'].value for _, c in one.found] == [10.0, 11.0]
    assert [c.values['rate'].value for _, c in other.found] == [30.0, 31.0]


def injector(factor):
    return (EffectDescription(name='rate', parameters={'well': 'injector', 'factor': factor}),)


def test_the_next_recording_expects_the_cause_that_was_found_at_its_size():
    prior = prior_from([pump(0.7)])
    expected, other_size = prior.weight(injector(0.71)), prior.weight(injector(1.2))
    unknown = prior.weight((EffectDescription(name='leak', parameters={'rate': 9.0}),))
    assert expected > 50 * unknown
    assert other_size == pytest.approx(unknown, rel=0.01)
    assert prior.weight(()) == pytest.approx(unknown)


def test_one_of_two_believed_leaks_is_expected_at_either_place():
    prior = prior_from([leaks((0.2, 10.0), (0.7, 30.0), date=TUESDAY)])
    near, between = (
        prior.weight((EffectDescription(name='leak', parameters={'x': x, 'z': 0.2}),))
        for x in (0.7, 0.45)
    )
    assert near > 20 * between


NOTHING = finding(verdict='none', confidence=0.9)


@pytest.mark.parametrize('earlier', [[], [finding(verdict='unexplained')], [pump(0.7), NOTHING]])
def test_without_a_cause_nothing_is_expected(earlier):
    prior = prior_from(earlier)
    assert prior.weight(()) == prior.weight(injector(0.7)) == 1.0
