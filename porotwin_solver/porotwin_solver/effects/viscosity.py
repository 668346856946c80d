"""The tracer's viscosity differs: mu = mu_water * viscosity_ratio ** c."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_VISCOSITY_RATIO
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import factor


def thicken(physics: Physics, values: Values) -> Physics:
    """Return `physics` with this viscosity ratio."""
    return replace(physics, viscosity_ratio=values['viscosity_ratio'])


def candidates(_context: SearchContext) -> Sequence[Candidate]:
    """Fit the ratio, starting from 1."""
    parameter = FitParameter('viscosity_ratio', '-', 1.0, 0.1, 0.02, 50.0, log=True)
    return [Candidate('viscosity', (parameter,))]


def phrase(values: Values) -> str:
    """Say how much more or less viscous the tracer is."""
    viscous = factor(
        values['viscosity_ratio'], 'more viscous than', 'less viscous than', 'as viscous as'
    )
    return f'the tracer is {viscous} water'


def draw(generator: Generator, _context: DrawContext) -> DrawnValues:
    """Draw a tracer that is 1.2 to 1.7 times thicker or thinner than water."""
    return {'viscosity_ratio': log_uniform(generator, 1.2, 1.7) ** random_sign(generator)}


EFFECT = Effect(
    name='viscosity',
    order=30,
    scope=Scope.RIG,
    parameters={
        'viscosity_ratio': Parameter(
            unit='-', low=1.0 / MOST_VISCOSITY_RATIO, high=MOST_VISCOSITY_RATIO, neutral=1.0
        )
    },
    on_physics=thicken,
    candidates=candidates,
    phrase=phrase,
    plainly='the tracer is thicker or thinner than water',
    laboratory_check='measure the stock in a capillary viscometer',
    blind_draw=draw,
    appearance=Appearance.BENDING,
    present=lambda physics: {'viscosity_ratio': physics.viscosity_ratio},
    # The flow is solved on coarser cells. On recordings with a true viscosity the normalised misfit
    # was 0.26 to 0.69, with other true effects half of that.
    misfit_allowance=1.5,
)
