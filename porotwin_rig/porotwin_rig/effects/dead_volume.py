"""The tube of a well is full of water at first: its tracer arrives volume / rate late."""

from porotwin_core.model.effect_limits import MOST_TUBE_ML
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect


def tube_ml(values: Values) -> float:
    """Return the volume [ml]."""
    return float(values['volume'])


EFFECT = AssetEffect(
    name='dead_volume',
    order=106,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'volume': Parameter(unit='ml', low=0.0, high=MOST_TUBE_ML),
    },
    tube_ml=tube_ml,
    is_repeatable=True,
    longest_step=15.0,
)
