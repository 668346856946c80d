"""The porosity is not the nominal one: porosity * factor everywhere."""

from dataclasses import replace

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another porosity."""
    return replace(rig, porosity=rig.porosity * values['factor'])


EFFECT = AssetEffect(
    name='porosity',
    order=80,
    parameters=PARAMETERS['porosity'],
    on_rig=change,
    is_repeatable=True,
)
