"""A pump swings about its rate: the factor is 1 + amplitude sin(2 pi t / period), at least 0."""

import math

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect


def rate_factor(values: Values, start: float, end: float) -> float:
    """Return the mean of the factor [-] of the rate from `start` to `end` [s]."""
    frequency = 2.0 * math.pi / float(values['period'])
    swing = (math.cos(frequency * start) - math.cos(frequency * end)) / (frequency * (end - start))
    return max(0.0, 1.0 + float(values['amplitude']) * swing)


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw an injector that swings by 20 to 50 % with a period of 0.4 to 0.8 recordings."""
    return {
        'well': context.wells[0],
        'amplitude': log_uniform(generator, 0.2, 0.5),
        'period': log_uniform(generator, 0.4, 0.8) * context.duration,
    }


EFFECT = AssetEffect(
    name='pulsation',
    order=280,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'amplitude': Parameter(unit='-'),
        'period': Parameter(unit='s', above=0.0, default=600.0),
    },
    shape=('period',),
    rate_factor=rate_factor,
    is_repeatable=True,
    longest_step=15.0,
    blind_draw=draw,
)
