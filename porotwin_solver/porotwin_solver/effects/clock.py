"""The photograph stamped t shows the rig at pump time t + offset."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import time_span


def shift(operator: ObservationOperator, values: Values) -> ObservationOperator:
    """Return `operator` with a larger clock offset."""
    return replace(operator, clock_offset=operator.clock_offset + values['offset'])


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the offset in steps of 1 % of the recording."""
    duration = context.duration
    parameter = FitParameter('offset', 's', 0.0, 0.01 * duration, -0.9 * duration, duration)
    return [Candidate('clock', (parameter,))]


def phrase(values: Values) -> str:
    """Say by how much the camera's clock is behind the clock of the pumps, or ahead of it."""
    way = 'ahead of' if values['offset'] < 0 else 'behind'
    return f'the clock of the camera is {time_span(abs(values["offset"]))} {way} that of the pumps'


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw an offset of 1.2 to 7 % of the recording."""
    return {
        'offset': random_sign(generator) * log_uniform(generator, 0.012, 0.07) * context.duration
    }


def gradient_obstacle(_physics: Physics, _parameter: str) -> str:
    """Refuse every gradient: the adjoint steps through fixed times."""
    return 'not available; leave it out'


EFFECT = Effect(
    name='clock',
    order=170,
    scope=Scope.CAMERA,
    parameters={
        'offset': Parameter(unit='s', low=-LONGEST_EXPERIMENT_S, high=LONGEST_EXPERIMENT_S)
    },
    on_observation=shift,
    candidates=candidates,
    phrase=phrase,
    plainly='the clocks of camera and pumps differ',
    laboratory_check='ask whether the pumps ran before their first known rates, which looks like a '
    'late clock of the camera; photograph the clock of the pumps',
    blind_draw=draw,
    appearance=Appearance.DELAY,
    moves_time=True,
    gradient_obstacle=gradient_obstacle,
)
