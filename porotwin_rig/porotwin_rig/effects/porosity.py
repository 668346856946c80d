"""The porosity is not the nominal one: porosity * factor everywhere."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another porosity."""
    return replace(rig, porosity=rig.porosity * values['factor'])


EFFECT = AssetEffect(
    name='porosity',
    order=80,
    parameters={
        'factor': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0),
    },
    on_rig=change,
    is_repeatable=True,
)
