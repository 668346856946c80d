"""The camera's signal is c ** exponent."""

import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray


def bend(signal: FloatArray, _grid: Grid, _time: float, values: Values) -> FloatArray:
    """Return the signal (nz, nx) [-] of a camera with a nonlinear response, c ** exponent."""
    return np.clip(signal, 0.0, None) ** values['exponent']


EFFECT = AssetEffect(
    name='saturation',
    order=140,
    parameters={
        'exponent': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0)
    },
    on_signal=bend,
    is_repeatable=True,
)
