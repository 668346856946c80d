"""The engine: conservation of tracer, splitting, local time steps, decay."""

import itertools
import math

import numpy as np
import pytest
from effect_examples import PHYSICAL, described
from solver_cases import SIDES, rough_map

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.coefficients.refinement import refine
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import PRESETS
from porotwin_solver.transport.scheme import Scheme

UNBALANCED = {('closed', 'leak')}
"""Sides and effects that the model refuses: the rates do not balance."""


@pytest.mark.parametrize(
    ('sides', 'effect'),
    [pair for pair in itertools.product(SIDES, [None, *PHYSICAL]) if pair not in UNBALANCED],
)
@pytest.mark.parametrize('preset', PRESETS)
def test_the_tracer_is_conserved(make_rig, preset, sides, effect) -> None:
    """initial + injected = final + lost, to 1e-12 of initial + injected."""
    rig = make_rig(boundaries=SIDES[sides])
    rates = {
        'injector': WellRate(from_ml_h(500.0), 0.9),
        'control1': WellRate(from_ml_h(100.0), 0.0),
        'producer': WellRate(from_ml_h(-600.0)),
    }
    grid = rig.grid(31, 19)
    model = Model(rig, grid, preset=preset, effects=[described(effect)] if effect else [])
    engine = model.engine
    state = State.equilibrium(refine(rough_map((19, 31), 4), engine.grid.shape))
    storage = engine.physics.storage
    begin = math.fsum((storage * engine.mean_concentration(state)).ravel())
    engine.advance(state, rates, 90.0)
    end = math.fsum((storage * engine.mean_concentration(state)).ravel())
    injected = 90.0 * math.fsum(engine.sources_and_sinks.sources(rates).tracer.ravel())
    if effect == 'decay':
        assert end + state.tracer_lost.sum() < begin + injected
        return
    balance = begin + injected - end - state.tracer_lost.sum()
    assert abs(balance) < 1e-12 * (begin + injected)
    assert state.tracer_lost[0] > 0.0


def test_decay_follows_its_law_during_injection(rig, rates) -> None:
    """d(tracer)/dt = injected - rate * tracer, as long as no tracer leaves the rig."""
    model = Model(rig, rig.grid(93, 56), preset='fast', effects=[described('decay')])
    state = State.equilibrium(model.initial_condition())
    model.engine.advance(state, rates, 1200.0)
    injected = rates['injector'].rate
    expected = injected / 1e-4 * (1.0 - math.exp(-1e-4 * 1200.0))
    assert model.quantity_of_interest('tracer_volume', state.mobile) == pytest.approx(
        expected,
        rel=1e-5,  # Strang splitting, steps of 60 s
    )


def test_local_time_steps_agree_with_a_common_time_step(rig, rates) -> None:
    """The levels change the order of the updates, and the result by less than 5 %."""
    physics = nominal_physics(rig, rig.grid(93, 56))
    for scheme in Scheme:
        engine = Engine(physics, scheme=scheme)
        local = State.equilibrium(np.zeros(physics.grid.shape))
        common = local.copy()
        engine.advance(local, rates, 600.0)
        for _ in range(600):  # so small that nearly all cells take one step each
            engine.advance(common, rates, 1.0)
        change = np.linalg.norm(local.mobile - common.mobile) / np.linalg.norm(common.mobile)
        assert change < 0.05, f'{scheme.name}: {change}'
