"""A uniform Darcy flux is imposed through all four sides, in addition to the wells."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_VELOCITY
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with more background flux."""
    x, z = rig.background_flux or (0.0, 0.0)
    return replace(rig, background_flux=(x + values['x_velocity'], z + values['z_velocity']))


EFFECT = AssetEffect(
    name='background_flow',
    order=130,
    parameters={
        'x_velocity': Parameter(unit='m/s', low=-MOST_VELOCITY, high=MOST_VELOCITY, default=0.0),
        'z_velocity': Parameter(unit='m/s', low=-MOST_VELOCITY, high=MOST_VELOCITY, default=0.0),
    },
    on_rig=change,
    is_repeatable=True,
)
