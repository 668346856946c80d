"""A round reflection adds to the signal, rising: strength exp(-r^2 / (2 radius^2))."""

import numpy as np
from numpy.random import Generator

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray


def reflect(signal: FloatArray, grid: Grid, time: float, values: Values) -> FloatArray:
    """Return the signal with the reflection, which has risen for `time` [s]."""
    height = values['z'] + values['climb'] * time
    distance = np.hypot(grid.x[None, :] - values['x'], grid.z[:, None] - height)
    return signal + values['strength'] * np.exp(-0.5 * (distance / values['radius']) ** 2)


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a reflection of 4 cm radius right of the injector, which rises by 20 cm."""
    well, size = context.injector, context.size
    return {
        'x': well.x_m + 0.2 * size,
        'z': max(well.z_m - 0.08 * size, 0.0),
        'radius': 0.04 * size,
        'strength': log_uniform(generator, 0.4, 0.8),
        'climb': 0.2 * size / context.duration,
    }


EFFECT = AssetEffect(
    name='reflection',
    order=260,
    parameters={
        'x': Parameter(unit='m'),
        'z': Parameter(unit='m'),
        'radius': Parameter(unit='m', above=0.0, default=0.03),
        'strength': Parameter(unit='-'),
        'climb': Parameter(unit='m/s', default=0.0),
    },
    shape=('x', 'z', 'radius', 'climb'),
    on_signal=reflect,
    is_repeatable=True,
    blind_draw=draw,
)
