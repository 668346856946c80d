"""A uniform Darcy flux is imposed through all four sides, in addition to the wells."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_DARCY_FLUX
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import direction


def drift(physics: Physics, values: Values) -> Physics:
    """Return `physics` with more background flux."""
    x, z = physics.background_flux
    return replace(physics, background_flux=(x + values['x_velocity'], z + values['z_velocity']))


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit both components in steps that move fronts by one cell.

    Where water stands at several places, its levels drive such a flow: see `water_level`.
    """
    if len(context.rig.water_bodies) > 1:
        return []
    step = context.front_speed * context.porosity
    return [
        Candidate(
            'background_flow',
            (
                FitParameter('x_velocity', 'm/s', 0.0, step, -MOST_DARCY_FLUX, MOST_DARCY_FLUX),
                FitParameter('z_velocity', 'm/s', 0.0, step, -MOST_DARCY_FLUX, MOST_DARCY_FLUX),
            ),
        )
    ]


def phrase(values: Values) -> str:
    """Say how much water flows, and where to."""
    return (
        'water flows through the whole rig beside the wells: a Darcy flux of '
        f'{direction(values["x_velocity"], "right", "left", "mm/h", 3.6e6)} and '
        f'{direction(values["z_velocity"], "up", "down", "mm/h", 3.6e6)}'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a flux that moves tracer by 4 to 15 mm sideways and 1 to 15 mm up or down."""
    unit = context.size * context.porosity / context.duration
    return {
        'x_velocity': random_sign(generator) * log_uniform(generator, 4e-3, 1.5e-2) * unit,
        'z_velocity': random_sign(generator) * log_uniform(generator, 1e-3, 1.5e-2) * unit,
    }


EFFECT = Effect(
    name='background_flow',
    order=130,
    scope=Scope.RIG,
    parameters={
        'x_velocity': Parameter(
            unit='m/s', low=-MOST_DARCY_FLUX, high=MOST_DARCY_FLUX, default=0.0, vector='velocity'
        ),
        'z_velocity': Parameter(
            unit='m/s', low=-MOST_DARCY_FLUX, high=MOST_DARCY_FLUX, default=0.0, vector='velocity'
        ),
    },
    on_physics=drift,
    candidates=candidates,
    phrase=phrase,
    plainly='water flows through the whole rig',
    laboratory_check='inject a drop of tracer with all pumps stopped and see where it drifts',
    blind_draw=draw,
    appearance=Appearance.SHIFT,
    residual_terms=('dc/dx',),
)
