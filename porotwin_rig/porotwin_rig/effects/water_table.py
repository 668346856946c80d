"""The water table sways: potential amplitude sin(2 pi t / period) (x / W - 1/2) on open sides."""

from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def sway(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this tilt of the water table."""
    return replace(rig, table_amplitude=values['amplitude'], table_period=values['period'])


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw an amplitude of 1 to 2.5 mm and a period of 0.5 to 1.2 times the recording."""
    return {
        'amplitude': log_uniform(generator, 1e-3, 2.5e-3),
        'period': log_uniform(generator, 0.5, 1.2) * context.duration,
    }


EFFECT = AssetEffect(
    name='water_table',
    order=250,
    parameters={
        'amplitude': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE),
        'period': Parameter(unit='s', above=0.0, default=1800.0),
    },
    shape=('period',),
    on_rig=sway,
    longest_step=30.0,
    blind_draw=draw,
)
