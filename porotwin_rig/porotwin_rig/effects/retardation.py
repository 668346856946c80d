"""The tracer sorbs linearly: storage = pore volume * retardation_factor."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_RETARDATION
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with a larger retardation factor."""
    retardation_factor = rig.retardation_factor * values['retardation_factor']
    return replace(rig, retardation_factor=retardation_factor)


EFFECT = AssetEffect(
    name='retardation',
    order=40,
    parameters={
        'retardation_factor': Parameter(unit='-', low=1.0, high=MOST_RETARDATION, neutral=1.0),
    },
    on_rig=change,
    is_repeatable=True,
)
