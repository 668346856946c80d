"""The camera's signal is c ** exponent."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.view import View


def _bend(view: View, values: Values) -> View:
    return replace(view, exponent=view.exponent * values['exponent'])


EFFECT = Effect('saturation', {'exponent': Parameter('-', above=0.0)}, on_view=_bend)
