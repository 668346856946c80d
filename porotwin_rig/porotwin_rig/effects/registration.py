"""A point p of the rig appears at C + scale R(rotation) (p - C) + (dx, dz), C the rig's middle.

It does so since a time."""

import math

import cv2
import numpy as np

from porotwin_core.geometry.grid import Grid
from porotwin_core.model.effect_limits import MOST_DISTANCE, MOST_FACTOR, MOST_ROTATION
from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray


def displace(signal: FloatArray, grid: Grid, time: float, values: Values) -> FloatArray:
    """Return the displaced signal (nz, nx); beyond the edge of the rig it looks like the edge."""
    if time < values['since']:
        return signal
    rotation, scale = values['rotation'], values['scale']
    middle_x, middle_z = 0.5 * grid.width, 0.5 * grid.height
    x, z = np.meshgrid(grid.x, grid.z)
    along = (x - middle_x - values['dx']) / scale
    up = (z - middle_z - values['dz']) / scale
    from_x = middle_x + math.cos(rotation) * along + math.sin(rotation) * up
    from_z = middle_z - math.sin(rotation) * along + math.cos(rotation) * up
    return np.asarray(
        cv2.remap(
            signal.astype(np.float32),
            (from_x / grid.dx - 0.5).astype(np.float32),
            (from_z / grid.dz - 0.5).astype(np.float32),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        float,
    )


EFFECT = AssetEffect(
    name='registration',
    order=160,
    parameters={
        'dx': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
        'dz': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
        'rotation': Parameter(unit='rad', low=-MOST_ROTATION, high=MOST_ROTATION, default=0.0),
        'scale': Parameter(
            unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, default=1.0, neutral=1.0
        ),
        'since': ONSET,
    },
    shape=('since',),
    on_picture=displace,
    is_repeatable=True,
)
