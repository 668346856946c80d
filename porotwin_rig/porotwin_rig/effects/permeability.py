"""The permeability is not the described one: permeability * factor everywhere."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_PERMEABILITY_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another permeability."""
    return replace(rig, permeability=rig.permeability * values['factor'])


EFFECT = AssetEffect(
    name='permeability',
    order=75,
    parameters={
        'factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
            is_logarithmic=True,
        )
    },
    on_rig=change,
    is_repeatable=True,
)
