"""A well opens at another place than the nominal one, by (dx, dz)."""

from dataclasses import replace

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
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
    parameters=PARAMETERS['well_position'],
    on_rig=move,
    is_repeatable=True,
)
