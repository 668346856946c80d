"""The tracer's viscosity differs: mu = mu_water * viscosity_ratio ** c."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_VISCOSITY_RATIO
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this viscosity ratio."""
    return replace(rig, viscosity_ratio=values['viscosity_ratio'])


EFFECT = AssetEffect(
    name='viscosity',
    order=30,
    parameters={
        'viscosity_ratio': Parameter(
            unit='-', low=1.0 / MOST_VISCOSITY_RATIO, high=MOST_VISCOSITY_RATIO, neutral=1.0
        ),
    },
    on_rig=change,
    longest_step=15.0,
)
