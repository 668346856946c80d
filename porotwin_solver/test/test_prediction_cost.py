"""Tests of the estimate: its substeps are those that the model takes, on every grid and preset."""

import numpy as np
import pytest

from lab.benches.bench_solver import bench_rig
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Boundaries
from porotwin_solver.model.engine import LONGEST_STEP, State
from porotwin_solver.model.model import Model
from porotwin_solver.model.prediction_cost import (
    PredictionCost,
    in_words,
    prediction_cost,
    slowness_of_this_machine,
    working_rates,
)
from porotwin_solver.transport.local_time_steps import tape_length

RIG = bench_rig()


@pytest.mark.parametrize('text', ['47x28', '94x56', '187x56'])
@pytest.mark.parametrize('preset', ['fast', 'accurate'])
def test_the_substeps_are_those_of_the_model(text: str, preset: str) -> None:
    grid = Grid.parse(text, RIG.width_m, RIG.height_m)
    engine = Model(RIG, grid, preset=preset).engine
    state = State.equilibrium(np.zeros(engine.grid.shape))
    true = tape_length(engine.coefficients(state, working_rates(RIG), LONGEST_STEP).levels)
    cost = prediction_cost(RIG, grid, preset=preset, duration=10 * LONGEST_STEP)
    assert cost.cells == engine.grid.nx * engine.grid.nz
    assert cost.steps == 10
    assert cost.substeps / cost.steps == pytest.approx(true, rel=0.25)


def test_the_cost_grows_with_time_and_cells_and_slowness() -> None:
    def seconds(text: str, duration: float, slowness: float = 1.0) -> float:
        grid = Grid.parse(text, RIG.width_m, RIG.height_m)
        return prediction_cost(RIG, grid, duration=duration, slowness=slowness).seconds

    assert seconds('94x56', 6000.0) == pytest.approx(10 * seconds('94x56', 600.0), rel=1e-5)
    assert seconds('374x224', 600.0) > 6 * seconds('187x112', 600.0)
    assert seconds('94x56', 600.0, 3.0) == pytest.approx(3 * seconds('94x56', 600.0))


def test_this_machine_is_timed() -> None:
    assert slowness_of_this_machine(RIG) > 0


@pytest.mark.parametrize(
    ('seconds', 'words'), [(0.0234, '0.02 s'), (34.4, '34 s'), (600.0, '10 min'), (9e4, '25 h')]
)
def test_a_duration_is_told_in_a_unit_that_fits(seconds: float, words: str) -> None:
    assert in_words(seconds) == words


def test_a_cost_below_a_millisecond_is_told_in_words() -> None:
    cost = PredictionCost(100, 1, 1, 100, 6e-5, 0.02)
    assert '; less than 1 ms for a prediction, after 0.02 s of preparation' in str(cost)


def test_wells_that_only_a_leak_balances_have_a_cost() -> None:
    closed = RIG.model_copy(update={'boundaries': Boundaries(top='closed')})
    first, second, *_ = RIG.wells
    rates = {first: WellRate(1.4e-7), second: WellRate(-1.5e-7)}
    usual = {**rates, second: WellRate(-1.4e-7)}
    leaky, balanced = (
        prediction_cost(closed, RIG.grid(94, 56), duration=600.0, rates=one).substeps
        for one in (rates, usual)
    )
    assert leaky == pytest.approx(balanced, rel=0.2)
