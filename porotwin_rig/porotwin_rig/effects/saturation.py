"""The camera's signal is c ** exponent."""

import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray


def bend(signal: FloatArray, _grid: Grid, _time: float, values: Values) -> FloatArray:
    """Return the signal (nz, nx) [-] of a camera with a nonlinear response, c ** exponent."""
    return np.clip(signal, 0.0, None) ** values['exponent']


EFFECT = AssetEffect(
    name='saturation',
    order=140,
    parameters=PARAMETERS['saturation'],
    on_signal=bend,
    is_repeatable=True,
)
