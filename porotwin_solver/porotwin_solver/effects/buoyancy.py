"""The tracer's density differs from water's: q = -k/mu (grad p + density_difference c g e_z)."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _weigh(physics: Physics, values: Values) -> Physics:
    return replace(physics, density_difference=values['density_difference'])


EFFECT = Effect('buoyancy', {'density_difference': Parameter('kg/m3')}, on_physics=_weigh)
