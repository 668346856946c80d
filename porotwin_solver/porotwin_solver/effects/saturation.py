"""The camera's signal is c ** exponent."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Reading, Values
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import number


def bend(operator: ObservationOperator, values: Values) -> ObservationOperator:
    """Return `operator` with another exponent."""
    return replace(operator, exponent=operator.exponent * values['exponent'])


def candidates(_context: SearchContext) -> Sequence[Candidate]:
    """Fit the exponent, starting from a linear response."""
    return [
        Candidate('saturation', (FitParameter('exponent', '-', 1.0, 0.1, 0.1, 10.0, log=True),))
    ]


def phrase(values: Values) -> str:
    """Say the exponent."""
    return f'the camera’s signal is the concentration to the power of {number(values["exponent"])}'


def draw(generator: Generator, _context: DrawContext) -> DrawnValues:
    """Draw an exponent of 1.4 to 2, or its inverse."""
    return {'exponent': log_uniform(generator, 1.4, 2.0) ** random_sign(generator)}


EFFECT = Effect(
    name='saturation',
    order=140,
    scope=Scope.CAMERA,
    parameters={
        'exponent': Parameter(
            unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0, reading=Reading(1.0, '')
        ),
    },
    on_observation=bend,
    candidates=candidates,
    phrase=phrase,
    plainly='the response of the camera is bent',
    laboratory_check='photograph three bottles of stock diluted to known concentrations',
    blind_draw=draw,
    appearance=Appearance.FADING,
    pales_core=True,
    needs_simulation=False,
)
