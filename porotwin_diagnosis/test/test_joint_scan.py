"""Two missing effects are found together by sparse regression of one residual."""

import numpy as np
import pytest
from diagnosis_examples import candidate, sample_of

from porotwin_diagnosis.search.joint_scan import promising_groups
from porotwin_diagnosis.search.levels import make_levels

RATE, POROSITY, CLOCK = 'rate injector', 'porosity', 'clock'


@pytest.fixture(scope='module')
def levels(denser_sand):
    return make_levels([sample_of(denser_sand)], progress=lambda _stage, _share: None)


def couples(levels, names, most=5):
    base = candidate(levels.samples, RATE)
    fit = levels.screening.evaluate((base,), np.array([0.5]))
    others = [candidate(levels.samples, name) for name in names]
    return promising_groups(levels.screening.forwards, others, (), size=2, beside=fit, most=most)


def test_the_couple_with_the_true_effect_comes_first(levels):
    """The sand of the recording is denser than described."""
    first, *others = couples(levels, [POROSITY, CLOCK, 'decay'])
    assert POROSITY in {member.label for member in first}
    assert len(others) == 2


def test_a_start_moves_towards_the_true_strength(levels):
    first, *_ = couples(levels, [POROSITY, CLOCK])
    started = next(member for member in first if member.label == POROSITY)
    assert started.described(started.first).parameters['factor'] < 1.0


def test_no_more_couples_than_asked_for_are_returned(levels):
    assert len(couples(levels, [POROSITY, CLOCK, 'decay'], most=1)) == 1


def test_three_effects_are_looked_for_at_once_beside_none(levels):
    null = levels.screening.evaluate((), np.zeros(0))
    names = [POROSITY, CLOCK, 'decay', RATE]
    found = promising_groups(
        levels.screening.forwards,
        [candidate(levels.samples, name) for name in names],
        ('leak',),
        size=3,
        beside=null,
        most=3,
    )
    labels = [{member.label for member in group} for group in found]
    assert POROSITY in labels[0]
    assert all(len(group) == 3 for group in labels)
    assert len({frozenset(group) for group in labels}) == 3
