"""Blinded cases: drawn reproducibly, of every kind."""

from porotwin_validation.blind_cases import KINDS, draw_case


def test_cases_are_drawn_reproducibly_and_of_every_kind():
    drawn = [draw_case(number, 1) for number in range(60)]
    assert [case.effects for case in drawn] == [draw_case(n, 1).effects for n in range(60)]
    assert {case.kind for case in drawn} == {'none', 'outside', 'left out', 'pair', 'single'}
    for case in drawn:
        if case.kind == 'left out':
            assert case.effects[0].name in case.withheld
        if case.kind == 'outside':
            assert case.right[0] == 'unexplained'


def test_the_shares_of_the_kinds_are_as_documented():
    counts = {kind: KINDS.count(kind) for kind in KINDS}
    assert counts == {'none': 3, 'single': 9, 'outside': 3, 'pair': 3, 'left out': 2}
