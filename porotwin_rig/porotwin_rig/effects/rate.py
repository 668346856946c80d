"""One pump delivers factor times the metered rate since a time."""

from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, share_after


def rate_factor(values: Values, start: float, end: float) -> float:
    """Return the mean factor in [start, end] [s]."""
    return float(1.0 + (values['factor'] - 1.0) * share_after(values['since'], start, end))


EFFECT = AssetEffect(
    name='rate',
    order=100,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, neutral=1.0),
        'since': ONSET,
    },
    shape=('since',),
    rate_factor=rate_factor,
    is_repeatable=True,
)
