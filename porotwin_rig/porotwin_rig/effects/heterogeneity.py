"""A round zone is more or less permeable, its edge smooth over 0.12 of its radius."""

from dataclasses import replace

import numpy as np

from porotwin_core.model.effect_limits import LEAST_RADIUS, MOST_DISTANCE, MOST_PERMEABILITY_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig

EDGE = 0.12
"""Width of the edge relative to the radius."""


def change_zone(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another permeability in the zone."""
    x, z = rig.element_places
    radius = values['radius']
    distance = np.hypot(x - values['x'], z - values['z'])
    inside = 0.5 * (1.0 - np.tanh((distance - radius) / (EDGE * radius)))
    factor = values['permeability_factor'] ** inside
    return replace(rig, permeability=rig.permeability * factor)


EFFECT = AssetEffect(
    name='heterogeneity',
    order=70,
    parameters={
        'x': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE),
        'z': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE),
        'radius': Parameter(unit='m', low=LEAST_RADIUS, high=MOST_DISTANCE),
        'permeability_factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
        ),
    },
    shape=('x', 'z', 'radius'),
    on_rig=change_zone,
    is_repeatable=True,
)
