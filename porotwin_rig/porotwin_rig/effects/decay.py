"""Dissolved tracer fades or is lost at first order: dc/dt = -rate c."""

import math

from porotwin_core.model.effect_limits import MOST_CHANGE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.tracer import Tracer
from porotwin_rig.true_rig import TrueRig


def fade(tracer: Tracer, rig: TrueRig, values: Values, duration: float) -> Tracer:
    """Return the tracer after `duration` [s]; tracer in immobile water fades as well."""
    remaining = math.exp(-values['rate'] * duration)
    if rig.immobile_fraction is None:
        return tracer._replace(mobile=tracer.mobile * remaining)
    return Tracer(tracer.mobile * remaining, tracer.stationary * remaining)


EFFECT = AssetEffect(
    name='decay',
    order=50,
    parameters={'rate': Parameter(unit='1/s', low=0.0, high=MOST_CHANGE)},
    on_tracer=fade,
    removes_tracer=True,
    longest_step=30.0,
    is_repeatable=True,
)
