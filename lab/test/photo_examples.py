"""A small rig with two sands, and a baseline photograph with grains, for tests."""

import cv2
import numpy as np

from porotwin_core.rig import Rig, rig_from_maps

PICTURE = (300, 480)
"""Rows and columns of the photograph."""
GRID = (27, 44)
"""Rows and columns of maps."""


def small_rig() -> Rig:
    """Return a rig of 0.88 x 0.54 m, more permeable in its upper half."""
    permeability = np.full(GRID, 4.7e-10)
    permeability[GRID[0] // 2 :] = 4.2e-9
    return rig_from_maps(
        {
            'name': 'two sands',
            'width_m': 0.88,
            'height_m': 0.54,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'wells': {
                'left': {'x_m': 0.3, 'z_m': 0.38},
                'right': {'x_m': 0.62, 'z_m': 0.4},
            },
            'camera': {'corners_px': [[20, 15], [20, 285], [460, 285], [460, 15]]},
        },
        {'depth_m': 0.01, 'porosity': 0.4, 'permeability_m2': permeability},
    )


def textured_baseline() -> np.ndarray:
    """Return pixels, uint8, shape (rows, columns, 3), with grains and a lighter lower half."""
    generator = np.random.default_rng(5)
    grains = cv2.GaussianBlur(generator.normal(0, 1, PICTURE).astype(np.float32), (0, 0), 1.0)
    level = np.full(PICTURE, 95.0)
    level[PICTURE[0] // 2 :] = 135.0
    shade = level + 40 * grains
    pixels = np.stack([0.75 * shade, 0.9 * shade, shade], axis=-1)
    return np.clip(pixels + 0.5, 20, 235).astype(np.uint8)
