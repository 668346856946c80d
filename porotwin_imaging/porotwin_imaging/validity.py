"""Where a photograph of the rig can say something about tracer, judged from the baseline.

Nothing can be read off the colour checker, bolts, tubes and thermocouples, dark frames and deep
shadow, glare, and the water that stands above the sand. The masks are made once per baseline on
the sampling grid (finer than the map), where a bolt or a tube is many samples wide.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Mask = NDArray[np.bool_]

LEAST_LIGHT = 0.012
"""Linear brightness below which a sample is frame or deep shadow, relative to the photo's white."""
GLARE = 0.955
"""Linear value (grey level 250) from which a channel is over-exposed."""


def lit(colours: Array) -> Mask:
    """Return where the linear `colours` (rows, columns, 3) are neither dark nor over-exposed."""
    smooth = cv2.blur(colours, (5, 5))
    return (smooth.mean(axis=2) > LEAST_LIGHT) & (colours.max(axis=2) < GLARE)
