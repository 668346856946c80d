"""The tube of a well is full of water at first: its tracer arrives volume / rate late."""

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
from porotwin_rig.effects.definition.asset_effect import AssetEffect


def tube_ml(values: Values) -> float:
    """Return the volume [ml]."""
    return float(values['volume'])


EFFECT = AssetEffect(
    name='dead_volume',
    order=106,
    parameters=PARAMETERS['dead_volume'],
    tube_ml=tube_ml,
    is_repeatable=True,
    longest_step=15.0,
)
