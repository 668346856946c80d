"""Whether several baselines show the same sand: none may show a hand, an object or tracer.

Baselines are averaged, so that something in front of the sand in one of them would be in all maps.
Light drifts from baseline to baseline, and the camera shakes. Both are corrected before.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.geometry.frame import LARGE_SHARE, VALIDITY
from porotwin_imaging.light.light_check import SMALLEST_WINDOW, window_mean

Array = NDArray[Any]
Mask = NDArray[np.bool_]

_MOST_CHANGE = 0.12
"""Sand that is brighter or darker by more in a channel is not the same [log ratio]. A tenth of
stock darkens as much. Light, shake, noise and strong compression stay below 0.1 on real and
rendered photographs."""


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
    size = max(SMALLEST_WINDOW, round(visible.shape[1] / VALIDITY.windows_across)) | 1
    changed = np.abs(window_mean(residual, visible, size)).max(axis=2) > _MOST_CHANGE
    share = float((changed & visible).sum() / max(1, visible.sum()))
    if share > LARGE_SHARE:
        raise InputError(
            f'differs from {first} on {100 * share:.1f} % of the sand: one of the two shows a '
            'hand, an object, a shadow or tracer; remove that one from the baselines (a running '
            'twin forgets its first baseline only at a restart)'
        )
