"""The plates bulge: the nominal depth at the sides, times factor_centre in the middle.

depth = nominal * (1 + (factor_centre - 1) (1 - ((x - W/2) / (W/2))^2)), a parabola in x.
"""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, factor_off_one
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Process, Scope
from porotwin_solver.effects.definition.words import factor


def bulge(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another depth."""
    half = physics.grid.width / 2.0
    parabola = 1.0 - ((physics.grid.x - half) / half) ** 2
    return replace(
        physics, depth=physics.depth * (1.0 + (values['factor_centre'] - 1.0) * parabola)
    )


def candidates(_context: SearchContext) -> Sequence[Candidate]:
    """Fit the factor, starting from flat plates."""
    return [Candidate('depth', (FitParameter('factor_centre', '-', 1.0, 0.02, 0.1, 5.0),))]


def phrase(values: Values) -> str:
    """Say how the plates stand in the middle."""
    apart = factor(
        values['factor_centre'], 'further apart', 'closer together', 'as far apart as nominal'
    )
    return f'the plates stand {apart} in the middle'


def draw(generator: Generator, _context: DrawContext) -> DrawnValues:
    """Draw plates that stand 4 to 15 % further apart or closer together in the middle."""
    return {'factor_centre': factor_off_one(generator, 0.04, 0.15)}


EFFECT = Effect(
    name='depth',
    order=90,
    scope=Scope.RIG,
    parameters={
        'factor_centre': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0)
    },
    on_physics=bulge,
    candidates=candidates,
    phrase=phrase,
    plainly='the plates bulge',
    laboratory_check='measure the gap between the plates in the middle with a feeler gauge',
    blind_draw=draw,
    changes=Process.STORAGE,
    appearance=Appearance.DELAY,
)
