"""Dissolved tracer fades or is lost at first order: dc/dt = -rate c, from injection on."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _fade(physics: Physics, values: Values) -> Physics:
    return replace(physics, decay_rate=physics.decay_rate + values['rate'])


EFFECT = Effect('decay', {'rate': Parameter('1/s', low=0.0)}, on_physics=_fade)
