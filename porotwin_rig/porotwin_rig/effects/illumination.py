"""The light changes: signal = c (1 + level + drift t + gradient (x - W/2)) since a time."""

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.effect_limits import MOST_CHANGE, MOST_FACTOR, MOST_LIGHT_GRADIENT
from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray


def light(signal: FloatArray, grid: Grid, time: float, values: Values) -> FloatArray:
    """Return the signal in the light at `time` [s]."""
    if time < values['since']:
        return signal
    drift = values['level'] + values['drift'] * time
    return signal * (1.0 + drift + values['gradient'] * (grid.x - 0.5 * grid.width))[None, :]


EFFECT = AssetEffect(
    name='illumination',
    order=150,
    parameters={
        'level': Parameter(unit='-', low=-1.0, high=MOST_FACTOR, default=0.0),
        'drift': Parameter(unit='1/s', low=-MOST_CHANGE, high=MOST_CHANGE, default=0.0),
        'gradient': Parameter(
            unit='1/m', low=-MOST_LIGHT_GRADIENT, high=MOST_LIGHT_GRADIENT, default=0.0
        ),
        'since': ONSET,
    },
    shape=('since',),
    on_signal=light,
    is_repeatable=True,
)
