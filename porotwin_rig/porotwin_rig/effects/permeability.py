"""The permeability is not the described one: permeability * factor everywhere."""

from dataclasses import replace

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another permeability."""
    return replace(rig, permeability=rig.permeability * values['factor'])


EFFECT = AssetEffect(
    name='permeability',
    order=75,
    parameters=PARAMETERS['permeability'],
    on_rig=change,
    is_repeatable=True,
)
