"""The tracer sorbs linearly: R phi dc/dt + div(q c) = ...; the camera sees the dissolved c."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _hold(physics: Physics, values: Values) -> Physics:
    factor = physics.retardation_factor * values['retardation_factor']
    return replace(physics, retardation_factor=factor)


EFFECT = Effect('retardation', {'retardation_factor': Parameter('-', low=1.0)}, on_physics=_hold)
