"""A point p of the rig appears at C + scale R(rotation) (p - C) + (dx, dz), C the rig's middle."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.view import View


def _move(view: View, values: Values) -> View:
    return replace(
        view,
        dx=values['dx'],
        dz=values['dz'],
        rotation=values['rotation'],
        scale=values['scale'],
    )


EFFECT = Effect(
    'registration',
    {
        'dx': Parameter('m', default=0.0),
        'dz': Parameter('m', default=0.0),
        'rotation': Parameter('rad', default=0.0),
        'scale': Parameter('-', above=0.0, default=1.0),
    },
    on_view=_move,
)
