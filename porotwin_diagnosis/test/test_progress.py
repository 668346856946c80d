"""Tests of the progress of a diagnosis."""

import math

import pytest

from porotwin_diagnosis.progress import (
    ALL_TRIED,
    FIRST_TRIED,
    MOST,
    SEARCH_ENDED,
    SINGLES_JUDGED,
    WorkClock,
    steps_of,
)

TRIED_S = 25.0
"""Time of the first try of all effects, on the canal tank."""


class Machine:
    """A machine with a clock."""

    def __init__(self, *, quick: bool = False) -> None:
        self.now = 0.0
        self.clock = WorkClock(quick=quick, now=lambda: self.now)
        self.ends: list[float] = []

    def reach(self, position: float, seconds: float) -> None:
        self.now += seconds
        self.clock.reach(position)
        self.ends.append(self.now + self.clock.left)

    def try_effects(self) -> None:
        self.reach(FIRST_TRIED, 40.0)  # it starts
        assert math.isinf(self.clock.left)
        assert self.clock.share == 0.0
        self.reach(0.05, 0.7 * TRIED_S)
        self.reach(ALL_TRIED, 0.3 * TRIED_S)

    def go_through(self, stages: list[float], share: float) -> None:
        before = max(end for end in MOST if end < stages[0])
        for end in stages:
            for half in (0.5 * (before + end), end):
                self.reach(half, 0.5 * share * MOST[end] * TRIED_S)
            before = end

    @property
    def known_ends(self) -> list[float]:
        return [end for end in self.ends if math.isfinite(end)]


@pytest.mark.parametrize('share', [0.1, 0.5, 1.0])
@pytest.mark.parametrize('quick', [True, False])
def test_the_end_never_becomes_later_on_a_steady_machine(share: float, quick: bool) -> None:
    machine = Machine(quick=quick)
    machine.try_effects()
    left_out = (0.56, SEARCH_ENDED) if quick else ()
    machine.go_through([end for end in MOST if end > ALL_TRIED and end not in left_out], share)
    assert machine.known_ends == sorted(machine.known_ends, reverse=True)
    assert machine.known_ends[-1] >= machine.now - 1e-9
    assert machine.clock.share == pytest.approx(1.0)


def test_stages_that_are_left_out_make_the_end_earlier() -> None:
    machine = Machine()
    machine.try_effects()
    machine.go_through([0.15, SINGLES_JUDGED], 0.5)
    before = machine.clock.left
    assert machine.clock.left_for_singles == 0.0
    machine.reach(SEARCH_ENDED, 1.0)
    assert machine.clock.left == pytest.approx(MOST[1.0] * TRIED_S)
    assert machine.clock.left < 0.1 * before


def test_a_slower_machine_makes_the_end_later() -> None:
    machine = Machine()
    machine.try_effects()
    before = machine.clock.left
    machine.go_through([0.15], 3.0)
    assert machine.clock.left > 2.0 * before


def test_steps_count_when_they_end() -> None:
    told: list[tuple[str, float]] = []
    step = steps_of(lambda stage, position: told.append((stage, position)), 0.2, 0.1, 2)
    with step('first'), step('second'):
        assert told == [('first', 0.2), ('second', 0.2)]
    assert told[2:] == [('second', pytest.approx(0.25)), ('first', pytest.approx(0.3))]
