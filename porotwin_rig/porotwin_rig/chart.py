"""The Classic colour chart as it hangs in the scene."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]

PATCHES: dict[str, tuple[float, float, float]] = {
    'dark skin': (0.1737, 0.0788, 0.0529),
    'light skin': (0.5598, 0.2774, 0.2109),
    'blue sky': (0.1042, 0.1889, 0.3289),
    'foliage': (0.1057, 0.1508, 0.0508),
    'blue flower': (0.2274, 0.2124, 0.4264),
    'bluish green': (0.1153, 0.5074, 0.4111),
    'orange': (0.7459, 0.2021, 0.0299),
    'purplish blue': (0.0587, 0.1012, 0.3877),
    'moderate red': (0.5601, 0.0802, 0.1146),
    'purple': (0.1092, 0.0420, 0.1381),
    'yellow green': (0.3328, 0.4974, 0.0426),
    'orange yellow': (0.7710, 0.3579, 0.0204),
    'blue': (0.0210, 0.0475, 0.2841),
    'green': (0.0461, 0.2920, 0.0615),
    'red': (0.4462, 0.0364, 0.0406),
    'yellow': (0.8417, 0.5744, 0.0047),
    'magenta': (0.5223, 0.0778, 0.2893),
    'cyan': (-0.0439, 0.2337, 0.3772),
    'white': (0.8795, 0.8850, 0.8342),
    'neutral 8': (0.5845, 0.5922, 0.5845),
    'neutral 6.5': (0.3577, 0.3671, 0.3653),
    'neutral 5': (0.1901, 0.1909, 0.1898),
    'neutral 3.5': (0.0859, 0.0887, 0.0898),
    'black': (0.0314, 0.0315, 0.0323),
}
"""Linear sRGB (red, green, blue) of the chart made since November 2014, row by row from dark skin;
colour-science's published values, adapted to D65 (Bradford)."""

PATCH_SHARE = 0.86
"""Side of a patch relative to the distance of two patches; between them the chart is black."""


def chart_colours(columns: FloatArray, rows: FloatArray) -> FloatArray:
    """Return linear (red, green, blue) of points of the chart; columns 0..6 right, rows 0..4 down.

    Outside the patches the chart's black frame; shape of the input plus (3,).
    """
    table = np.array(list(PATCHES.values())).reshape(4, 6, 3)
    i, j = np.floor(columns).astype(int), np.floor(rows).astype(int)
    on_chart = (i >= 0) & (i < 6) & (j >= 0) & (j < 4)
    margin = 0.5 * (1.0 - PATCH_SHARE)
    u, v = columns - i, rows - j
    on_patch = on_chart & (u > margin) & (u < 1 - margin) & (v > margin) & (v < 1 - margin)
    colours = np.maximum(table[np.clip(j, 0, 3), np.clip(i, 0, 5)], 0.0)
    return np.where(on_patch[..., None], colours, 0.012)
