"""A well opens at another place than the nominal one, by (dx, dz)."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def move(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with the well displaced."""
    x, z, radius = rig.places[values['well']]
    moved = (x + values['dx'], z + values['dz'], radius)
    return replace(rig, places={**rig.places, values['well']: moved})


EFFECT = AssetEffect(
    name='well_position',
    order=110,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'dx': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
        'dz': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
    },
    on_rig=move,
    is_repeatable=True,
)
