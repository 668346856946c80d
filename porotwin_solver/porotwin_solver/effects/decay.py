"""Dissolved tracer fades or is lost at first order: dc/dt = -rate c, from injection on."""

import math
from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_limits import MOST_CHANGE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Process, Scope
from porotwin_solver.effects.definition.words import number, time_span


def fade(physics: Physics, values: Values) -> Physics:
    """Return `physics` with a higher decay rate."""
    return replace(physics, decay_rate=physics.decay_rate + values['rate'])


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the rate in steps that lose 3 % of the tracer within the recording."""
    duration = context.duration
    parameter = FitParameter(
        'rate', '1/s', 0.0, 0.03 / duration, 0.0, min(20.0 / duration, MOST_CHANGE)
    )
    return [Candidate('decay', (parameter,))]


def phrase(values: Values) -> str:
    """Say the rate and the half-life."""
    rate = values['rate']
    if rate <= 0:
        return 'the tracer fades or is lost at no rate'
    half_life = time_span(math.log(2) / rate)
    return (
        f'the tracer fades or is lost at {number(3600 * rate)} per hour, half of it in {half_life}'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a rate that loses 11 to 39 % of the first tracer by the end."""
    return {'rate': log_uniform(generator, 0.12, 0.5) / context.duration}


EFFECT = Effect(
    name='decay',
    order=50,
    scope=Scope.RIG,
    parameters={'rate': Parameter(unit='1/s', low=0.0, high=MOST_CHANGE)},
    on_physics=fade,
    candidates=candidates,
    phrase=phrase,
    plainly='the tracer fades',
    laboratory_check=(
        'leave a closed bottle of stock in the same light and photograph it every hour'
    ),
    blind_draw=draw,
    changes=Process.STORAGE,
    appearance=Appearance.FADING,
    pales_core=True,
)
