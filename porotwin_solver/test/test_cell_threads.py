"""Threads that share the cells of a grid: the same bits for any number of them."""

import numpy as np
import pytest
from effect_examples import described

from porotwin_core.rig import EffectDescription
from porotwin_solver.coefficients.cell_threads import (
    BLOCK_CELLS,
    LIMIT,
    at_most,
    in_blocks,
    in_rows,
    most_threads,
)
from porotwin_solver.model.engine import State
from porotwin_solver.model.model import Model
from porotwin_solver.transport import transport

LARGE = (650, 390)
"""Columns and rows of a grid that is shared: its pressure takes multigrid, its substeps blocks."""


def test_the_environment_bounds_the_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT, '3')
    with at_most(2):
        assert most_threads() == 2
    assert most_threads() == 3
    monkeypatch.delenv(LIMIT)
    with at_most(2):
        assert most_threads() == 2
    assert most_threads() >= 1


def test_all_rows_and_cells_are_done_once() -> None:
    def count(done: np.ndarray, first: int, last: int) -> None:
        done[first:last] += 1

    def sums(part: np.ndarray, first: int, last: int) -> None:
        part[0] = last - first

    rows, total = np.zeros(10), np.zeros(1)
    with at_most(3):
        in_rows(count, 10, 1_000_000, rows)
        in_blocks(sums, 3 * BLOCK_CELLS + 5, (), total)
    np.testing.assert_array_equal(rows, 1.0)
    assert total[0] == 3 * BLOCK_CELLS + 5


@pytest.mark.parametrize('effects', [[], [described('dispersion')]], ids=['still', 'dispersed'])
def test_a_prediction_is_the_same_for_any_number_of_threads(
    rig, rates, effects: list[EffectDescription]
) -> None:
    found, lost = [], []
    for threads in (1, 3):
        with at_most(threads):
            model = Model(rig, rig.grid(*LARGE), preset='fast', effects=effects)
            state = State.equilibrium(model.initial_condition())
            state.mobile[50:300, 100:500] = 0.7
            begin = float(np.sum(model.engine.storage * state.mobile))
            model.engine.advance(state, rates, 20.0)
        found.append(state.mobile)
        lost.append(state.tracer_lost)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(lost[0], lost[1])
    injected = 20.0 * float(model.engine.sources_and_sinks.sources(rates).tracer.sum())
    end = float(np.sum(model.engine.storage * state.mobile))
    assert begin + injected == pytest.approx(end + state.tracer_lost.sum(), rel=1e-12)


def test_shared_cells_give_the_map_of_cells_that_are_not_shared(
    rig, rates, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = Model(rig, rig.grid(93, 56), preset='fast')
    alone = State.equilibrium(model.initial_condition())
    model.engine.advance(alone, rates, 120.0)
    monkeypatch.setattr(transport, 'THREADED_CELLS', 0)
    shared = State.equilibrium(model.initial_condition())
    model.engine.advance(shared, rates, 120.0)
    np.testing.assert_array_equal(alone.mobile, shared.mobile)
    np.testing.assert_allclose(alone.tracer_lost, shared.tracer_lost, rtol=1e-14)


def test_an_interrupted_step_leaves_nothing_for_the_next_one(rig, rates, monkeypatch) -> None:
    model = Model(rig, rig.grid(93, 56), preset='fast')
    alone = State.equilibrium(model.initial_condition())
    model.engine.advance(alone, rates, 120.0)
    monkeypatch.setattr(transport, 'THREADED_CELLS', 0)
    monkeypatch.setattr(transport, 'BLOCK_CELLS', 64)
    phases = []

    def interrupted(*args) -> None:
        phases.append(args)
        if len(phases) == 5:
            raise KeyboardInterrupt
        in_blocks(*args)

    with monkeypatch.context() as key, pytest.raises(KeyboardInterrupt):
        key.setattr(transport, 'in_blocks', interrupted)
        model.engine.advance(State.equilibrium(model.initial_condition()), rates, 120.0)
    again = State.equilibrium(model.initial_condition())
    model.engine.advance(again, rates, 120.0)
    np.testing.assert_array_equal(again.mobile, alone.mobile)
