"""The model itself smears: artificial diffusion on top of the diffusion of the scheme.

The diagnosis compares schemes to find it; no search fits it.
"""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_DIFFUSION
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.words import number


def smear(physics: Physics, values: Values) -> Physics:
    """Return `physics` with more artificial diffusion."""
    return replace(physics, model_diffusion=physics.model_diffusion + values['model_diffusion'])


def phrase(values: Values) -> str:
    """Say how much the scheme smears."""
    return (
        'the model itself smears, as by a diffusion of '
        f'{number(values["model_diffusion"])} m²/s; a sharper scheme closes the gap'
    )


def gradient_obstacle(physics: Physics, _parameter: str) -> str:
    """Refuse a gradient without any diffusion: no pair of cells exchanges tracer then."""
    if physics.diffusion + physics.model_diffusion == 0.0:
        return 'not available without any diffusion; give a little, such as 1e-10 m2/s'
    return ''


EFFECT = Effect(
    name='numerical_diffusion',
    order=0,
    scope=Scope.MODEL,
    parameters={'model_diffusion': Parameter(unit='m2/s', low=0.0, high=MOST_DIFFUSION)},
    on_physics=smear,
    phrase=phrase,
    laboratory_check='run the model with the accurate preset',
    gradient_obstacle=gradient_obstacle,
)
