"""The light changes: signal = c (1 + level + drift t + gradient (x - W/2)) since a time."""

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
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
    parameters=PARAMETERS['illumination'],
    shape=('since',),
    on_signal=light,
    is_repeatable=True,
)
