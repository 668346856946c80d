"""The panel of the water balance."""

from dataclasses import replace

from page_examples import content, expectation, two_cycles


def test_wells_sides_and_sands_have_a_line_each() -> None:
    assert content('water', two_cycles()) == []
    told = 'into the sand [ml/h]: injector +500.0; left +20.0; to the right: fine +9.0'
    now = replace(two_cycles(), expected=replace(expectation(), water=told))
    first, *others = content('water', now)
    assert first == 'into the sand [ml/h]: injector +500.0'
    assert len(others) == 2
