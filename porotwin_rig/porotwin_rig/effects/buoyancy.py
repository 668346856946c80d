"""The density of the tracer exceeds the density of water in proportion to the concentration."""

from dataclasses import replace

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with this density difference."""
    return replace(rig, density_difference=values['density_difference'])


EFFECT = AssetEffect(
    name='buoyancy',
    order=20,
    parameters=PARAMETERS['buoyancy'],
    on_rig=change,
    longest_step=15.0,
)
