"""Blinded cases: drawn reproducibly, of every kind."""

from lab.blind.blind_cases import KINDS, SEVERAL, draw_case


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


def test_a_check_of_combinations_has_three_effects_or_two_of_one_kind():
    drawn = [draw_case(number, 1, kinds=SEVERAL) for number in range(12)]
    three = [case for case in drawn if case.kind == 'three']
    alike = [case for case in drawn if case.kind == 'alike']
    assert {len({effect.name for effect in case.effects}) for case in three} == {3}
    assert {case.effects[0].name for case in alike} == {'rate', 'leak', 'heterogeneity'}
    for case in alike:
        first, second = case.effects
        assert first.name == second.name
        assert first.parameters != second.parameters
        wells = {str(effect.parameters.get('well')) for effect in case.effects}
        assert len(wells) == 2 or wells == {'None'}


def test_a_coarse_case_is_the_same_experiment():
    fine, coarse = draw_case(3, 1), draw_case(3, 1, coarse=True)
    assert coarse.cell_m == 2 * fine.cell_m
    assert (coarse.effects, coarse.schedule, coarse.seed) == (
        fine.effects,
        fine.schedule,
        fine.seed,
    )
