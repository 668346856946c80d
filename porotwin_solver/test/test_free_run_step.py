"""The longest step of a free run: slow rigs take long steps, and see the same maps."""

import numpy as np
import pytest
from effect_examples import described

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Boundaries, EffectDescription, Well
from porotwin_solver.model.engine import LONGEST_STEP, State
from porotwin_solver.model.free_run_step import longest_free_step
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import maps_of

DAY = 86400.0


def model_of(rig, *effects):
    return Model(rig, rig.grid(47, 28), preset='fast', effects=effects)


def rates_of(rate_ml_h):
    return {'injector': WellRate(from_ml_h(rate_ml_h), 1.0)}


@pytest.mark.parametrize('rate_ml_h', [100.0, 500.0, 1500.0])
def test_the_papers_rates_take_the_usual_steps(make_rig, rate_ml_h):
    physics = model_of(make_rig()).engine.physics
    assert longest_free_step(physics, rates_of(rate_ml_h)) == LONGEST_STEP


def test_slow_pumps_take_long_steps_and_resting_ones_no_limit(make_rig):
    physics = model_of(make_rig()).engine.physics
    slow, slower = (longest_free_step(physics, rates_of(rate)) for rate in (5.0, 0.5))
    assert slower == pytest.approx(10.0 * slow)
    assert longest_free_step(physics, {}) == np.inf


@pytest.mark.parametrize('effect', ['buoyancy', 'background_flow', 'decay', 'dual_porosity'])
def test_what_acts_without_pumps_bounds_the_step(make_rig, effect):
    physics = model_of(make_rig(), described(effect)).engine.physics
    assert longest_free_step(physics, {}) < np.inf


def maps_at_the_end(rig, effects, duration, step=None):
    """Return the maps after `duration` [s] at 5 ml/h, with steps of `step` [s] if it is given."""
    model = model_of(rig, *effects)
    schedule, initial = Schedule.constant(rates_of(5.0)), model.initial_condition()
    times = np.array([duration]) if step is None else np.arange(step, duration + 1.0, step)
    return list(maps_of(model, schedule, times, initial=initial, start=0.0))[-1]


@pytest.mark.parametrize('effect', [None, 'dispersion', 'decay', 'dual_porosity', 'viscosity'])
def test_long_steps_show_the_same_maps(make_rig, effect):
    effects = [described(effect)] if effect else []
    long, short = (maps_at_the_end(make_rig(), effects, 2.0 * DAY, step) for step in (None, 240.0))
    assert np.linalg.norm(long - short) < 0.02 * np.linalg.norm(short)


@pytest.mark.parametrize(
    ('effect', 'parameters', 'most'),
    [
        ('dual_porosity', {'immobile_fraction': 0.3, 'exchange_rate': 1.0}, 0.02),
        ('dual_porosity', {'immobile_fraction': 0.3, 'exchange_rate': 1e-2}, 0.02),
        ('viscosity', {'viscosity_ratio': 5.0}, 0.03),
    ],
)
def test_fast_pumps_see_the_maps_of_short_steps(make_rig, effect, parameters, most):
    model = model_of(make_rig(), EffectDescription(name=effect, parameters=parameters))
    rates = rates_of(8000.0)
    maps = []
    for step in (None, 0.5):
        state = State.equilibrium(np.zeros(model.engine.grid.shape))
        length = longest_free_step(model.engine.physics, rates) if step is None else step
        model.engine.advance(state, rates, 240.0, length)
        maps.append(model.engine.mean_concentration(state))
    assert np.linalg.norm(maps[0] - maps[1]) < most * np.linalg.norm(maps[1])


def test_exchange_within_a_second_equals_pores_without_immobile_water(make_rig):
    rates, maps = Schedule.constant(rates_of(4000.0)), []
    fast = {'immobile_fraction': 0.3, 'exchange_rate': 1.0}
    for effects in ((), (EffectDescription(name='dual_porosity', parameters=fast),)):
        model = model_of(make_rig(), *effects)
        initial = model.initial_condition()
        maps += maps_of(model, rates, np.array([400.0]), initial=initial, start=0.0)
    assert np.linalg.norm(maps[1] - maps[0]) < 0.03 * np.linalg.norm(maps[0])


def test_a_plume_that_sinks_alone_sees_the_maps_of_short_steps(make_rig) -> None:
    rig = make_rig(
        width_m=0.4,
        height_m=0.2,
        porosity=0.4,
        permeability_m2=1e-9,
        boundaries=Boundaries(top='closed'),
        wells={'injector': Well(x_m=0.2, z_m=0.15), 'producer': Well(x_m=0.2, z_m=0.05)},
    )
    dense = EffectDescription(name='buoyancy', parameters={'density_difference': 10.0})
    model = Model(rig, rig.grid(40, 20), preset='fast', effects=[dense])
    pumped = rates_of(100.0) | {'producer': WellRate(from_ml_h(-100.0))}
    schedule = Schedule.from_rates([(0.0, pumped), (600.0, dict.fromkeys(pumped, WellRate()))])
    initial = model.initial_condition()
    long, short = (
        list(maps_of(model, schedule, np.array(times), initial=initial, start=0.0))[-1]
        for times in ([900.0], np.arange(2.0, 901.0, 2.0))
    )
    assert np.linalg.norm(long - short) < 0.1 * np.linalg.norm(short)  # it was 0.32
