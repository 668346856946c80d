"""The camera's signal is c ** exponent."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.observation_operator import ObservationOperator


def _bend(operator: ObservationOperator, values: Values) -> ObservationOperator:
    return replace(operator, exponent=operator.exponent * values['exponent'])


EFFECT = Effect('saturation', {'exponent': Parameter('-', above=0.0)}, on_observation=_bend)
