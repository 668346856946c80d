"""Water is lost or gained at an unknown place, at a constant rate; what comes in is water."""

from dataclasses import replace

from porotwin_core.units import from_ml_h
from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Leak, Physics, SourceSink


def _leak(physics: Physics, values: Values) -> Physics:
    leak = Leak(SourceSink(values['x'], values['z']), from_ml_h(values['rate']))
    return replace(physics, leaks=(*physics.leaks, leak))


EFFECT = Effect(
    'leak',
    {'x': Parameter('m'), 'z': Parameter('m'), 'rate': Parameter('ml/h')},
    on_physics=_leak,
)
