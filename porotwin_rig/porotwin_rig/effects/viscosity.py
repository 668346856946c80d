"""The tracer's viscosity differs: mu = mu_water * viscosity_ratio ** c."""

from dataclasses import replace

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this viscosity ratio."""
    return replace(rig, viscosity_ratio=values['viscosity_ratio'])


EFFECT = AssetEffect(
    name='viscosity',
    order=30,
    parameters=PARAMETERS['viscosity'],
    on_rig=change,
    longest_step=15.0,
)
