"""Tests of the lines that compare a finding on a rig with the earlier ones."""

import pytest
from history_examples import MONDAY, TUESDAY, cause, finding, pump, value

from porotwin_diagnosis.history.comparison import compared
from porotwin_diagnosis.history.joint_belief import prior_from


def test_a_second_finding_that_agrees_is_no_drift():
    (line,) = compared([pump(0.7)], pump(0.71, TUESDAY))
    assert line == (
        'factor of the rate of injector: 0.71 now; believed before: 0.7 (0.68 to 0.72); '
        'together: 0.705 (0.691 to 0.719).'
    )


def test_a_difference_beyond_the_intervals_is_a_drift_with_its_rate_and_no_joint_value():
    assert compared([pump(0.7)], pump(0.8, TUESDAY)) == [
        'factor of the rate of injector drifts: 0.7 on 2026-11-23, 0.8 now. It rises by 0.1 a day. '
        'The effect is weaker now. Believed before: 0.7 (0.68 to 0.72).'
    ]


def test_recordings_of_one_hour_give_no_rate_of_a_drift():
    (line,) = compared([pump(0.7)], pump(0.8, MONDAY.replace('10:00:00', '10:00:01')))
    assert line.startswith(
        'factor of the rate of injector drifts: 0.7 on 2026-11-23, 0.8 now. The effect is weaker '
    )


def test_the_drift_of_an_effect_that_monday_could_not_tell_from_another_is_seen():
    both = [cause(name, **{key: value(1.15)}) for name, key in NAMES]
    monday = finding(*both, verdict='retardation', named=('retardation',))
    porous = [cause(name, **{key: value(1.3)}) for name, key in NAMES]
    tuesday = finding(*porous, date=TUESDAY, verdict='porosity', named=('porosity',))
    (line,) = compared([monday], tuesday)
    assert line.startswith(
        'porosity factor drifts: 1.15 on 2026-11-23, 1.3 now. It rises by 0.15 a day. '
        'The effect is stronger now.'
    )


@pytest.mark.parametrize(
    ('old', 'new', 'way'),
    [
        (0.5, 1.5, 'It rises by 1 a day. The effect acts the other way now.'),
        (0.8, 0.6512, 'It falls by 0.15 a day. The effect is stronger now.'),
    ],
)
def test_a_drift_says_which_way_it_goes(old, new, way):
    (line,) = compared([pump(old)], pump(new, TUESDAY))
    assert f' now. {way} Believed before' in line


def test_a_leak_that_moves_is_neither_weaker_nor_stronger():
    places = [cause('leak', x=value(x), z=value(0.3)) for x in (0.2, 0.28)]
    monday, tuesday = (finding(p, date=d) for p, d in zip(places, (MONDAY, TUESDAY), strict=True))
    line, same = compared([monday], tuesday)
    assert line.startswith('leak x drifts: 200 mm on 2026-11-23, 280 mm now')
    assert same.startswith('leak z: 300 mm now')


def test_a_leak_elsewhere_is_another_leak():
    places = [cause('leak', x=value(x), z=value(0.3)) for x in (0.2, 0.8)]
    monday, tuesday = (finding(p, date=d) for p, d in zip(places, (MONDAY, TUESDAY), strict=True))
    assert compared([monday], tuesday) == ['leak is new: no earlier recording showed it there.']
    assert len(prior_from([monday, tuesday]).causes) == 2


NAMES = (('retardation', 'retardation_factor'), ('porosity', 'factor'))


def test_causes_that_come_and_go_are_told():
    assert 'this is the first one' in compared([], pump(0.7))[0]
    gone = finding(verdict='none', date=TUESDAY)
    assert compared([pump(0.7)], gone) == ['rate, found on 2026-11-23, does not show today.']
    leak = finding(cause('leak', rate=value(9.0)), date=TUESDAY)
    assert compared([pump(0.7)], leak) == [
        'rate, found on 2026-11-23, is not named today.',
        'leak is new: no earlier recording showed it.',
    ]
    assert compared([pump(0.7)], finding(verdict='unexplained', date=TUESDAY)) == []


def test_a_cause_that_comes_back_is_told():
    wednesday = '2026-11-25T10:00:00+00:00'
    none = finding(verdict='none', date=TUESDAY)
    *_, line = compared([pump(0.7), none], pump(0.7, wednesday))
    assert line == 'wrong rate of injector is back: found on 2026-11-23, not on 2026-11-24.'
