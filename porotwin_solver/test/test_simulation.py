"""Simulations: symmetric, equal to consecutive predictions, and refinable."""

import numpy as np
import pytest
from effect_examples import described

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Well
from porotwin_solver.coefficients.refinement import coarsen
from porotwin_solver.effects import EFFECTS
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


BEGINNING = {
    'rate': ({'well': 'injector', 'factor': 0.5}, (0.5, 1.0)),
    'stock_strength': ({'well': 'injector', 'factor': 0.4}, (1.0, 0.4)),
}
"""Effects of the injector, with the share of its rate and of its concentration that they leave."""


@pytest.mark.parametrize('name', BEGINNING)
def test_an_onset_divides_a_run_into_one_without_and_one_with_the_effect(rig, rates, name) -> None:
    parameters, (share, strength) = BEGINNING[name]
    grid, times = rig.grid(47, 28), [300.0, 900.0, 1200.0]
    effect = EFFECTS[name].described(**parameters, since=700.0)
    after = WellRate(share * rates['injector'].rate, strength)
    in_two = Schedule.from_rates([(0.0, rates), (700.0, {**rates, 'injector': after})])
    schedule = Schedule.constant(rates)
    found = simulate(rig, schedule, times, grid=grid, preset='fast', effects=[effect])
    expected = simulate(rig, in_two, times, grid=grid, preset='fast')
    np.testing.assert_allclose(found, expected, atol=1e-14)
    assert np.abs(found[-1] - simulate(rig, schedule, times, grid=grid)[-1]).max() > 0.1


def test_the_camera_shows_an_effect_from_its_onset_on(rig, rates) -> None:
    grid, times, schedule = rig.grid(47, 28), [600.0, 900.0], Schedule.constant(rates)
    knocked = EFFECTS['registration'].described(dx=0.04, since=700.0)
    lamp = EFFECTS['illumination'].described(level=-0.5, since=700.0)
    plain = simulate(rig, schedule, times, grid=grid, preset='fast')
    seen = simulate(rig, schedule, times, grid=grid, preset='fast', effects=[knocked, lamp])
    np.testing.assert_array_equal(seen[0], plain[0])
    np.testing.assert_allclose(seen[1][:, 2:], 0.5 * plain[1][:, :-2], atol=1e-2)


def test_water_in_a_tube_delays_the_tracer_by_volume_over_rate(rig, rates) -> None:
    grid, times = rig.grid(47, 28), [300.0, 900.0]
    tube = EFFECTS['dead_volume'].described(well='injector', volume=25.0)  # ml, at 500 ml/h
    found = simulate(rig, Schedule.constant(rates), times, grid=grid, preset='fast', effects=[tube])
    water = {**rates, 'injector': WellRate(rates['injector'].rate, 0.0)}
    late = Schedule.from_rates([(0.0, water), (180.0, rates)])
    expected = simulate(rig, late, times, grid=grid, preset='fast')
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_prediction_follows_the_onsets(rig, rates) -> None:
    late, always = (
        EFFECTS['rate'].described(well='injector', factor=0.5, since=since) for since in (700.0, 0)
    )
    grid = rig.grid(47, 28)
    models = [Model(rig, grid, preset='fast', effects=[one]) for one in (late, always)]
    one, other = (model.predict(model.initial_condition(), rates, 60.0) for model in models)
    np.testing.assert_array_equal(one, other)
    assert models[0].at(699.0) is not models[0] is models[0].at(700.0)
    assert models[0].at(0.0) is models[0].at(699.0)
