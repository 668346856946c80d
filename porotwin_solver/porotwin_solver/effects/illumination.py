"""The light changes: signal = c (1 + drift t + gradient (x - W/2)), kept within 0..1."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.observation_operator import ObservationOperator


def _light(operator: ObservationOperator, values: Values) -> ObservationOperator:
    return replace(
        operator,
        drift=operator.drift + values['drift'],
        gradient=operator.gradient + values['gradient'],
    )


EFFECT = Effect(
    'illumination',
    {'drift': Parameter('1/s', default=0.0), 'gradient': Parameter('1/m', default=0.0)},
    on_observation=_light,
)
