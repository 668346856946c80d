"""A uniform Darcy flux is imposed through all four sides, beside the wells."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _drift(physics: Physics, values: Values) -> Physics:
    x, z = physics.background_flux
    return replace(physics, background_flux=(x + values['x_velocity'], z + values['z_velocity']))


EFFECT = Effect(
    'background_flow',
    {
        'x_velocity': Parameter('m/s', default=0.0),
        'z_velocity': Parameter('m/s', default=0.0),
    },
    on_physics=_drift,
)
