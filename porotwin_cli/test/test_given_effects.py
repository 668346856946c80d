"""Tests of the effects that a command is given."""

import pytest

from porotwin_cli.options.given_effects import given_effects
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_solver.effects import parse_effects


@pytest.mark.parametrize(
    'texts',
    [['leak:x=0.5,z=0.2,rate=1e6'], ['porosity:factor=0.8', 'porosity:factor=0.8']],
)
def test_effects_that_no_rig_file_may_hold_are_refused(texts: list[str]) -> None:
    with pytest.raises(InputError, match=r'leak|porosity'):
        given_effects(texts, load_rig(small_rig()))


def test_two_leaks_are_given_in_their_order() -> None:
    found = given_effects(
        ['leak:x=0.5,z=0.2,rate=10', 'leak:x=0.1,z=0.2,rate=5'], load_rig(small_rig())
    )
    assert [one.parameters['rate'] for one in found] == [10.0, 5.0]


def test_an_effect_on_top_of_the_same_one_in_the_rig_file_is_odd(
    caplog: pytest.LogCaptureFixture,
) -> None:
    rig = load_rig(small_rig())
    first, second, *_ = rig.wells
    held = rig.with_effects(parse_effects([f'rate:well={first},factor=0.9']))
    caplog.clear()
    given_effects([f'rate:well={second},factor=0.9', 'leak:x=0.1,z=0.2,rate=5'], held)
    assert not caplog.records
    given_effects([f'rate:well={first},factor=0.8'], held)
    assert len(caplog.records) == 1
    given_effects([f'rate:well={second},factor=80'], rig)
    assert len(caplog.records) == 2, 'a percentage'
