"""Whether several baselines show the same sand: none may show a hand, an object or tracer.

Baselines are averaged, so that something in front of the sand in one of them would be in all maps.
Light drifts from baseline to baseline, and the camera shakes. Both are corrected before.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError

Array = NDArray[Any]
Mask = NDArray[np.bool_]

_MOST_CHANGE = 0.12
"""Sand that is brighter or darker by more in a channel is not the same [log ratio]. A tenth of
stock darkens as much. Light, shake, noise and strong compression stay below 0.1 on real and
rendered photographs."""
_MOST_SHARE = 0.003
"""Share of the sand that may be different [-]. The smallest plumes of the first photographs of real
and rendered injections cover 0.008."""
_WINDOWS_ACROSS = 60
"""Windows of the averages across the rig: a fine grid has noisy cells."""
_LEAST_WINDOW = 3
"""Cells across the smallest window: one cell is noise."""


def common_light(log_ratio: Array, visible: Mask) -> Array:
    """Return the log gain (3,) of a baseline to the first: the median of the visible cells.

    Args:
        log_ratio: log ratio to the first baseline, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
    """
    return np.asarray(np.median(log_ratio[visible], axis=0))


def refuse_other_sand(residual: Array, visible: Mask, first: str) -> None:
    """Refuse a baseline that does not show the sand of the first one.

    Args:
        residual: log ratio to the first baseline without the drift of light, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        first: name of the first baseline.

    Raises:
        InputError: the sand differs on more than a small share.
    """
    changed = np.abs(_window_mean(residual, visible)).max(axis=2) > _MOST_CHANGE
    share = float((changed & visible).sum() / max(1, visible.sum()))
    if share > _MOST_SHARE:
        raise InputError(
            f'differs from {first} on {100 * share:.1f} % of the sand: one of the two shows a '
            'hand, an object, a shadow or tracer; remove that one from the baselines (a running '
            'twin forgets its first baseline only at a restart)'
        )


def _window_mean(residual: Array, visible: Mask) -> Array:
    """Return the mean of `residual` (nz, nx, 3) over the visible cells of windows."""
    size = max(_LEAST_WINDOW, round(visible.shape[1] / _WINDOWS_ACROSS)) | 1
    weight = cv2.blur(visible.astype(np.float32), (size, size))
    filled = np.where(visible[..., None], residual, 0.0).astype(np.float32)
    least = np.float32(1.0 / size**2)
    return np.asarray(cv2.blur(filled, (size, size)) / np.maximum(weight, least)[..., None])
