"""Water is lost or gained at an unknown place, at a constant rate; gained water has no tracer."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.model.blind_draw import (
    DrawContext,
    DrawnValues,
    log_uniform,
    place_near_injector,
    random_sign,
)
from porotwin_core.model.effect_limits import MOST_DISTANCE, MOST_LEAK_ML_H
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Leak, Physics, SourceSink
from porotwin_solver.effects.definition.candidate import (
    Candidate,
    FitParameter,
    PlaceSearch,
    SearchContext,
)
from porotwin_solver.effects.definition.effect import Appearance, Effect, Process, Scope
from porotwin_solver.effects.definition.words import number, place

EDGE_M = 0.006
"""Distance that a fitted leak keeps from the sides [m]."""

TRIAL_RATES = (0.05, -0.05)
"""Rates of the leaks that are tried, relative to the strongest pump. Inside the plume, water that
enters makes a hole, and water that is lost does not."""


def lose_or_gain(physics: Physics, values: Values) -> Physics:
    """Return `physics` with one more leak."""
    leak = Leak(SourceSink(values['x'], values['z']), from_ml_h(values['rate']))
    return replace(physics, leaks=(*physics.leaks, leak))


def leak_at(context: SearchContext, centre: tuple[float, float], rate_ml_h: float) -> Candidate:
    """Return the leak whose fit starts at `centre` [m] with `rate_ml_h`."""
    rig, size = context.rig, context.longer_side
    rate = FitParameter('rate', 'ml/h', 0.0, 8.0, -MOST_LEAK_ML_H, MOST_LEAK_ML_H)
    parameters = (
        FitParameter('x', 'm', centre[0], 0.0065 * size, EDGE_M, rig.width_m - EDGE_M),
        FitParameter('z', 'm', centre[1], 0.0065 * size, EDGE_M, rig.height_m - EDGE_M),
        rate,
    )
    return Candidate('leak', parameters, starts=((0.0, 0.0, rate.scaled(rate_ml_h)),))


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit a leak that starts in the middle; a rig closed on all sides cannot leak."""
    return [] if context.rig.closed else [leak_at(context, context.middle, 0.0)]


def trials(context: SearchContext, centre: tuple[float, float]) -> Sequence[Candidate]:
    """Try a gain and a loss.

    Raises:
        InputError: the rig is closed on all sides, or no pump ever runs, so that no rate says how
            large a leak may be.
    """
    if context.rig.closed:
        raise InputError('leak: the rig is closed on all sides; open one in rig.yaml')
    if context.strongest_rate == 0.0:
        raise InputError('leak: no pump ever runs; give a recording with a running pump')
    strongest = to_ml_h(context.strongest_rate)
    return [leak_at(context, centre, relative * strongest) for relative in TRIAL_RATES]


def phrase(values: Values) -> str:
    """Say where water enters or is lost, and how much."""
    event = 'water enters' if values['rate'] > 0 else 'water is lost'
    return f'{event} at {place(values)}: {number(abs(values["rate"]))} ml/h'


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a leak near the injector of 4 to 10 % of its rate."""
    x, z = place_near_injector(generator, context)
    rate = random_sign(generator) * log_uniform(generator, 0.04, 0.1) * context.injected_ml_h
    return {'x': x, 'z': z, 'rate': rate}


EFFECT = Effect(
    name='leak',
    order=120,
    scope=Scope.PLACE,
    parameters={
        'x': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'z': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'rate': Parameter(unit='ml/h', low=-MOST_LEAK_ML_H, high=MOST_LEAK_ML_H),
    },
    on_physics=lose_or_gain,
    candidates=candidates,
    places=PlaceSearch(trials, strength_factors=(0.0, 3.0)),
    phrase=phrase,
    laboratory_check='stop all pumps and watch the water table; dry the plates and look for drops',
    blind_draw=draw,
    changes=Process.SOURCE,
    appearance=Appearance.DELAY,
    is_learnable=True,
)
