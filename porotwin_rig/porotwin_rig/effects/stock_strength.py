"""A well injects factor times the commanded concentration since a time."""

from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, share_after


def stock_factor(values: Values, start: float, end: float) -> float:
    """Return the mean factor in [start, end] [s]."""
    return float(1.0 + (values['factor'] - 1.0) * share_after(values['since'], start, end))


EFFECT = AssetEffect(
    name='stock_strength',
    order=103,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'factor': Parameter(unit='-', low=0.0, high=1.0, neutral=1.0),
        'since': ONSET,
    },
    shape=('since',),
    stock_factor=stock_factor,
    is_repeatable=True,
)
