"""Water is lost or gained at an unknown place, at a constant rate; gained water has no tracer."""

from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.effect_limits import MOST_DISTANCE, MOST_LEAK_ML_H
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rates.wells import WellRate
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig

RADIUS_M = 0.004
"""Radius of the leak [m], equal to the default radius of a well."""


def add_leak(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with the leak as a source or sink of its own.

    Raises:
        InputError: the rig is closed on all sides.
    """
    if rig.rig.closed:
        raise InputError(
            'leak: in a rig whose sides are all closed, water is neither lost nor gained; open a '
            'side in rig.yaml'
        )
    earlier = sum(name.startswith('leak') for name in rig.constant_rates)
    name = f'leak {earlier + 1}' if earlier else 'leak'
    place = (values['x'], values['z'], RADIUS_M)
    rate = WellRate(from_ml_h(values['rate']))
    return replace(
        rig,
        places={**rig.places, name: place},
        constant_rates={**rig.constant_rates, name: rate},
    )


EFFECT = AssetEffect(
    name='leak',
    order=120,
    parameters={
        'x': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE),
        'z': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE),
        'rate': Parameter(unit='ml/h', low=-MOST_LEAK_ML_H, high=MOST_LEAK_ML_H),
    },
    shape=('x', 'z'),
    on_rig=add_leak,
    is_repeatable=True,
)
