"""The model itself smears: artificial diffusion, beside that of the scheme."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _smear(physics: Physics, values: Values) -> Physics:
    return replace(physics, model_diffusion=physics.model_diffusion + values['model_diffusion'])


EFFECT = Effect(
    'numerical_diffusion', {'model_diffusion': Parameter('m2/s', low=0.0)}, on_physics=_smear
)
