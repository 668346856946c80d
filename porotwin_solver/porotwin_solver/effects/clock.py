"""The photograph stamped t shows the rig at pump time t + offset."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.observation_operator import ObservationOperator


def _shift(operator: ObservationOperator, values: Values) -> ObservationOperator:
    return replace(operator, clock_offset=operator.clock_offset + values['offset'])


EFFECT = Effect('clock', {'offset': Parameter('s')}, on_observation=_shift)
