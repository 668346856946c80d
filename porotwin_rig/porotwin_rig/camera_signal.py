"""The camera signal of the visible tracer, with the effects of the camera."""

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid, conservative_resample
from porotwin_rig.virtual_rig import VirtualRig

FloatArray = NDArray[np.floating]


def signal_seen(rig: VirtualRig, grid: Grid, *, time: float) -> FloatArray:
    """Return the signal of the photograph at `time` [s] on `grid`, (nz, nx), 0 to 1, without noise.

    Effects on the brightness act first. A displacement of the picture follows, on cells half as
    large, to keep fronts sharp.
    """
    displaced = [(effect.on_picture, values) for effect, values in rig.effects if effect.on_picture]
    if not displaced:
        return _brightness(rig, grid, time)
    fine = grid.refined(2)
    signal = _brightness(rig, fine, time)
    for displace, values in displaced:
        signal = displace(signal, fine, time, values)
    return np.clip(conservative_resample(signal, grid.shape), 0.0, 1.0)


def _brightness(rig: VirtualRig, grid: Grid, time: float) -> FloatArray:
    signal = rig.concentration(grid)
    for effect, values in rig.effects:
        if effect.on_signal is not None:
            signal = effect.on_signal(signal, grid, time, values)
    return np.clip(signal, 0.0, 1.0)
