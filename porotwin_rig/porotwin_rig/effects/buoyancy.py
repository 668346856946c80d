"""The density of the tracer exceeds the density of water in proportion to the concentration."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_DENSITY_DIFFERENCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this density difference."""
    return replace(rig, density_difference=values['density_difference'])


EFFECT = AssetEffect(
    name='buoyancy',
    order=20,
    parameters={
        'density_difference': Parameter(
            unit='kg/m3', low=-MOST_DENSITY_DIFFERENCE, high=MOST_DENSITY_DIFFERENCE
        ),
    },
    on_rig=change,
    longest_step=15.0,
)
