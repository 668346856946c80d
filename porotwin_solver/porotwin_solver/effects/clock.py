"""The photograph stamped t shows the rig at pump time t + offset."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.view import View


def _shift(view: View, values: Values) -> View:
    return replace(view, clock_offset=view.clock_offset + values['offset'])


EFFECT = Effect('clock', {'offset': Parameter('s')}, on_view=_shift)
