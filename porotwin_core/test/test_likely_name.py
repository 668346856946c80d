"""The name that a user probably meant."""

import pytest

from porotwin_core.basis.likely_name import did_you_mean


@pytest.mark.parametrize(
    ('name', 'told'),
    [
        ('peer', "did you mean 'peers'?"),
        ('pers', "did you mean 'peers'?"),
        ('colour', ''),
        ('domain', ''),  # a key that is known elsewhere
        (5, ''),  # a key of a YAML file may be a number
    ],
)
def test_the_name_that_is_most_alike_is_told(name: object, told: str) -> None:
    assert did_you_mean(name, iter(['persons', 'peers', 'domain'])) == told


def test_the_section_is_told_and_does_not_count() -> None:
    assert did_you_mean('factor', ['factors'], within='sands.') == "did you mean 'sands.factors'?"
    assert did_you_mean('x', ['factors'], within='sands.') == ''


def test_short_names_may_need_more_likeness() -> None:
    assert did_you_mean('sorption', ['saturation'])
    assert not did_you_mean('sorption', ['saturation'], alike=0.7)
