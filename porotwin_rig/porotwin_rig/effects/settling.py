"""Tracer particles sink through the water at `velocity`."""

from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_limits import MOST_VELOCITY
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def sink(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this settling velocity."""
    return replace(rig, settling_velocity=values['velocity'])


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a velocity that sinks the tracer by 1 to 3 cm on the small rig."""
    return {'velocity': log_uniform(generator, 0.01, 0.03) * context.size / context.duration}


EFFECT = AssetEffect(
    name='settling',
    order=270,
    parameters={'velocity': Parameter(unit='m/s', low=0.0, high=MOST_VELOCITY)},
    on_rig=sink,
    longest_step=30.0,
    blind_draw=draw,
    # tracer that sinks evenly drifts evenly
    equal_to=('background_flow',),
)
