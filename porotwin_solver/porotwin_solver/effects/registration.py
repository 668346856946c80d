"""A point p of the rig appears at C + scale R(rotation) (p - C) + (dx, dz), C the rig's middle."""

import math
from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.observation_operator import ObservationOperator


def _move(operator: ObservationOperator, values: Values) -> ObservationOperator:
    """Move what `operator` shows already: two similarities in turn are one."""
    scale, rotation = values['scale'], values['rotation']
    cosine, sine = math.cos(rotation), math.sin(rotation)
    return replace(
        operator,
        dx=scale * (cosine * operator.dx - sine * operator.dz) + values['dx'],
        dz=scale * (sine * operator.dx + cosine * operator.dz) + values['dz'],
        rotation=operator.rotation + rotation,
        scale=operator.scale * scale,
    )


EFFECT = Effect(
    'registration',
    {
        'dx': Parameter('m', default=0.0),
        'dz': Parameter('m', default=0.0),
        'rotation': Parameter('rad', default=0.0),
        'scale': Parameter('-', above=0.0, default=1.0),
    },
    on_observation=_move,
)
