"""A point p of the rig appears at C + scale R(rotation) (p - C) + (dx, dz), C the rig's middle."""

import math
from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.view import View


def _move(view: View, values: Values) -> View:
    """Move what `view` shows already: two similarities in turn are one."""
    scale, rotation = values['scale'], values['rotation']
    cosine, sine = math.cos(rotation), math.sin(rotation)
    return replace(
        view,
        dx=scale * (cosine * view.dx - sine * view.dz) + values['dx'],
        dz=scale * (sine * view.dx + cosine * view.dz) + values['dz'],
        rotation=view.rotation + rotation,
        scale=view.scale * scale,
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
