"""One pump delivers factor times what it is told, all the time."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _misdeliver(physics: Physics, values: Values) -> Physics:
    well = physics.well(values['well'])
    factors = dict(physics.rate_factors)
    factors[well] = factors.get(well, 1.0) * values['factor']
    return replace(physics, rate_factors=factors)


EFFECT = Effect(
    'rate',
    {'well': Parameter('name', is_name=True), 'factor': Parameter('-', low=0.0)},
    on_physics=_misdeliver,
)
