"""Simulations: symmetric, equal to consecutive predictions, and refinable."""

import numpy as np
import pytest
from effect_examples import described

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Well
from porotwin_solver.coefficients.refinement import coarsen
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import PRESETS
from porotwin_solver.model.simulation import simulate, simulated_maps


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('effect', [None, 'dispersion', 'viscosity', 'dual_porosity'])
def test_a_mirrored_rig_gives_the_mirrored_map(make_rig, preset, effect) -> None:
    wells = {'injector': Well(x_m=0.3, z_m=0.2), 'producer': Well(x_m=0.7, z_m=0.4)}
    mirrored = {name: Well(x_m=0.934 - well.x_m, z_m=well.z_m) for name, well in wells.items()}
    rates = {
        'injector': WellRate(from_ml_h(500.0), 1.0),
        'producer': WellRate(from_ml_h(-400.0)),
    }
    effects = [described(effect)] if effect else []
    schedule = Schedule.constant(rates)
    maps = []
    for placed in (wells, mirrored):
        rig = make_rig(wells=placed)
        maps.append(
            simulate(rig, schedule, [900.0], grid=rig.grid(47, 28), preset=preset, effects=effects)
        )
    np.testing.assert_allclose(maps[0][0], maps[1][0][:, ::-1], atol=2e-8)


def test_consecutive_predictions_equal_a_simulation(rig, rates) -> None:
    grid = rig.grid(47, 28)
    model = Model(rig, grid, preset='fast')
    state = model.initial_condition()
    for _ in range(4):
        state = model.predict(state, rates, 30.0)
    maps = simulate(
        rig, Schedule.constant(rates), [30.0, 60.0, 90.0, 120.0], grid=grid, preset='fast'
    )
    np.testing.assert_allclose(maps[-1], state, atol=1e-14)


def test_a_refined_simulation_is_the_mean_of_one_on_the_fine_grid(make_rig) -> None:
    rig = make_rig()
    coarse, fine = rig.grid(24, 14), rig.grid(72, 42)
    schedule = Schedule.constant({'injector': WellRate(from_ml_h(600.0), 1.0)})
    refined = simulated_maps(rig, schedule, [900.0], grid=coarse, preset='fast', refinement=3)
    finer = simulated_maps(rig, schedule, [900.0], grid=fine, preset='fast')
    np.testing.assert_allclose(next(refined), coarsen(next(finer), coarse.shape), atol=1e-12)
