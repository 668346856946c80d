"""The plates bulge: the nominal depth at the sides, times factor_centre in the middle.

depth = nominal * (1 + (factor_centre - 1) (1 - ((x - W/2) / (W/2))^2)), a parabola in x.
"""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _bulge(physics: Physics, values: Values) -> Physics:
    half = physics.grid.width / 2.0
    parabola = 1.0 - ((physics.grid.x - half) / half) ** 2
    return replace(
        physics, depth=physics.depth * (1.0 + (values['factor_centre'] - 1.0) * parabola)
    )


EFFECT = Effect('depth', {'factor_centre': Parameter('-', above=0.0)}, on_physics=_bulge)
