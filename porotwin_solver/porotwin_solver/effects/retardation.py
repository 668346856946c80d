"""The tracer sorbs linearly: R phi dc/dt + div(q c) = ...; the camera sees the dissolved c."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_limits import MOST_RETARDATION
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Process, Scope
from porotwin_solver.effects.definition.words import number


def sorb(physics: Physics, values: Values) -> Physics:
    """Return `physics` with a larger retardation factor."""
    retardation_factor = physics.retardation_factor * values['retardation_factor']
    return replace(physics, retardation_factor=retardation_factor)


def candidates(_context: SearchContext) -> Sequence[Candidate]:
    """Fit the factor, starting without sorption."""
    parameter = FitParameter('retardation_factor', '-', 1.0, 0.015, 1.0, 20.0)
    return [Candidate('retardation', (parameter,))]


def phrase(values: Values) -> str:
    """Say how fast the tracer travels."""
    speed = number(100 / values['retardation_factor'])
    return f'the tracer sorbs to the sand and travels at {speed} % of the water’s speed'


def draw(generator: Generator, _context: DrawContext) -> DrawnValues:
    """Draw sorption that delays fronts by 1.5 to 8 %."""
    return {'retardation_factor': 1.0 + log_uniform(generator, 0.015, 0.08)}


def equal_to(_values: Values) -> tuple[str, ...]:
    """A higher porosity is the same: only the product of both factors shows in the maps."""
    return ('porosity',)


EFFECT = Effect(
    name='retardation',
    order=40,
    scope=Scope.RIG,
    parameters={
        'retardation_factor': Parameter(unit='-', low=1.0, high=MOST_RETARDATION, neutral=1.0)
    },
    on_physics=sorb,
    candidates=candidates,
    phrase=phrase,
    plainly='the tracer sorbs: it sticks to the sand for a while',
    laboratory_check='shake sand with stock and measure the concentration left in the water',
    blind_draw=draw,
    changes=Process.STORAGE,
    appearance=Appearance.DELAY,
    equal_to=equal_to,
    is_learnable=True,
)
