"""The signal lags behind the tracer, as a slow stain: d signal/dt = (c - signal) / delay."""

import math

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray


def lag(visible: FloatArray, dissolved: FloatArray, values: Values, duration: float) -> FloatArray:
    """Return the stain after `duration` [s] beside `dissolved` tracer."""
    if values['delay'] <= 0.0:
        return dissolved
    share = -math.expm1(-duration / values['delay'])
    return visible + share * (dissolved - visible)


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a delay of 5 to 16 % of the recording."""
    return {'delay': log_uniform(generator, 0.05, 0.16) * context.duration}


EFFECT = AssetEffect(
    name='stain',
    order=240,
    parameters={'delay': Parameter(unit='s', low=0.0)},
    on_visible=lag,
    blind_draw=draw,
)
