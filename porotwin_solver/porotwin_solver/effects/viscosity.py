"""The tracer's viscosity differs: mu = mu_water * viscosity_ratio ** c."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _thicken(physics: Physics, values: Values) -> Physics:
    return replace(physics, viscosity_ratio=values['viscosity_ratio'])


EFFECT = Effect('viscosity', {'viscosity_ratio': Parameter('-', above=0.0)}, on_physics=_thicken)
