"""A part of the pore water does not move: d c_im/dt = exchange_rate (c - c_im)."""

import math
from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_CHANGE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.tracer import Tracer
from porotwin_rig.true_rig import TrueRig


def divide(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this part of immobile water."""
    return replace(rig, immobile_fraction=values['immobile_fraction'])


def exchange(tracer: Tracer, rig: TrueRig, values: Values, duration: float) -> Tracer:
    """Return the tracer after `duration` [s] of exchange, by the exact solution.

    The sum of mobile, linearly sorbed and immobile tracer is kept.
    """
    immobile = values['immobile_fraction']
    if immobile <= 0.0:
        return tracer
    mobile = rig.mobile_fraction * rig.retardation_factor
    level = (mobile * tracer.mobile + tracer.stationary) / (mobile + immobile)
    remaining = math.exp(-values['exchange_rate'] * duration * (mobile + immobile) / mobile)
    difference = (tracer.mobile - tracer.stationary / immobile) * remaining
    concentration = level + difference * (immobile / (mobile + immobile))
    return Tracer(concentration, immobile * (concentration - difference))


EFFECT = AssetEffect(
    name='dual_porosity',
    order=60,
    parameters={
        'immobile_fraction': Parameter(unit='-', low=0.0, high=0.95),
        'exchange_rate': Parameter(unit='1/s', low=0.0, high=MOST_CHANGE),
    },
    shape=('exchange_rate',),
    on_rig=divide,
    on_tracer=exchange,
    longest_step=15.0,
)
