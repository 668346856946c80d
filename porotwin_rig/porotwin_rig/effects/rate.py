"""One pump delivers factor times the metered rate, all the time."""

from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect


def rate_factor(values: Values, _start: float, _end: float) -> float:
    """Return the factor."""
    return float(values['factor'])


EFFECT = AssetEffect(
    name='rate',
    order=100,
    parameters={
        'well': Parameter(unit='name', is_name=True),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, neutral=1.0),
    },
    rate_factor=rate_factor,
    is_repeatable=True,
)
