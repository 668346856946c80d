"""A pump wears out: the factor of its rate is 1 + drift t, at least 0."""

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect


def rate_factor(values: Values, start: float, end: float) -> float:
    """Return the mean factor in [start, end] [s]."""
    return max(0.0, 1.0 + float(values['drift']) * 0.5 * (start + end))


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw an injector that delivers 6 to 20 % less at the end."""
    return {
        'well': context.wells[0],
        'drift': -log_uniform(generator, 0.06, 0.2) / context.duration,
    }


EFFECT = AssetEffect(
    name='pump_drift',
    order=210,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'drift': Parameter(unit='1/s'),
    },
    rate_factor=rate_factor,
    is_repeatable=True,
    longest_step=30.0,
    blind_draw=draw,
)
