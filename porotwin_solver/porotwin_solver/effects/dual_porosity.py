"""A part of the pore water does not move: d c_im/dt = exchange_rate (c - c_im).

The camera sees the mean of both, weighted by volume.
"""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _divide(physics: Physics, values: Values) -> Physics:
    return replace(
        physics,
        immobile_fraction=values['immobile_fraction'],
        exchange_rate=values['exchange_rate'],
    )


EFFECT = Effect(
    'dual_porosity',
    {
        'immobile_fraction': Parameter('-', low=0.0, high=0.95),
        'exchange_rate': Parameter('1/s', low=0.0),
    },
    on_physics=_divide,
)
