"""A uniform Darcy flux is imposed through all four sides, in addition to the wells."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from porotwin_core.basis.units import HOUR_S
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_VELOCITY
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import direction

DRIFT_M_H = 0.006
"""Standard deviation of how far water drifts beside the wells in an hour, each way [m]."""


def drift(physics: Physics, values: Values) -> Physics:
    """Return `physics` with more background flux."""
    x, z = physics.background_flux
    return replace(physics, background_flux=(x + values['x_velocity'], z + values['z_velocity']))


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit both components in steps that move fronts by one cell.

    Levels at several places, or in the sand, drive such a flow by themselves: see `water_level`.
    """
    if len(context.rig.water_bodies) > 1 or context.rig.water_table:
        return []
    return [_in_steps(context.front_speed * context.porosity)]


def believed(rig: Rig) -> Sequence[Candidate]:
    """Believe in water that drifts by about DRIFT_M_H, each way."""
    if rig.water_table:
        return []
    porosity = float(np.mean(rig.nominal_map('porosity')))
    return [_in_steps(DRIFT_M_H / HOUR_S * porosity)]


def _in_steps(step: float) -> Candidate:
    most = MOST_VELOCITY
    names = ('x_velocity', 'z_velocity')
    parameters = (FitParameter(name, 'm/s', 0.0, step, -most, most) for name in names)
    return Candidate('background_flow', tuple(parameters))


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
            unit='m/s', low=-MOST_VELOCITY, high=MOST_VELOCITY, default=0.0, vector='velocity'
        ),
        'z_velocity': Parameter(
            unit='m/s', low=-MOST_VELOCITY, high=MOST_VELOCITY, default=0.0, vector='velocity'
        ),
    },
    on_physics=drift,
    candidates=candidates,
    phrase=phrase,
    plainly='water flows through the whole rig',
    laboratory_check='inject a drop of tracer with all pumps stopped and see where it drifts',
    blind_draw=draw,
    appearance=Appearance.SHIFT,
    believed=believed,
    is_learnable=True,
)
