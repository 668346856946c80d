"""The porosity is not what is believed: porosity * factor everywhere."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _scale(physics: Physics, values: Values) -> Physics:
    return replace(physics, porosity=physics.porosity * values['factor'])


EFFECT = Effect('porosity', {'factor': Parameter('-', above=0.0)}, on_physics=_scale)
