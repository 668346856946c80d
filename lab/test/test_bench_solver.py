"""The baseline of the solver's benchmark is itself a correct model."""

import numpy as np
import pytest

from lab.benches.bench_large_grids import large_grid_cost
from lab.benches.bench_solver import PlainModel, bench_rig, bench_schedule, errors
from porotwin_core.geometry.grid import conservative_resample
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.model.model import Model


def test_the_plain_model_conserves_the_tracer_and_stays_bounded() -> None:
    rig = bench_rig()
    physics = nominal_physics(rig, rig.grid(47, 28))
    model, rates = PlainModel(physics), bench_schedule().at(0.0)
    state = model.predict(np.zeros(physics.grid.shape), rates, 30.0)
    injected = 30.0 * rates['injector'].rate
    assert (physics.storage * state).sum() == pytest.approx(injected, rel=1e-12)
    assert 0.0 <= state.min() <= state.max() <= 1.0


def test_the_plain_model_agrees_with_the_upwind_preset() -> None:
    rig, schedule = bench_rig(), bench_schedule()
    grid = rig.grid(93, 56)
    plain, model = PlainModel(nominal_physics(rig, grid)), Model(rig, grid, preset='upwind')
    state, other = model.initial_condition(), model.initial_condition()
    for frame in range(20):
        rates = schedule.at(30.0 * frame)
        state, other = plain.predict(state, rates, 30.0), model.predict(other, rates, 30.0)
    assert np.linalg.norm(state - other) < 0.15 * np.linalg.norm(other)


def test_errors_compare_with_the_means_of_the_finer_map() -> None:
    fine = np.random.default_rng(1).random((12, 18))
    coarse = conservative_resample(fine, (4, 6))
    assert errors(np.array([coarse]), np.array([fine])) == [0.0]


def test_a_large_grid_loses_no_tracer() -> None:
    cost = large_grid_cost(140, 75, frames=4)
    assert abs(cost.lost) < 1e-12
    assert cost.nanoseconds > 0.0
