"""A relative scale: 0 to 1 by the core of the plume, where nothing tells the concentration.

Without a pump log and without a known dilution the strongest tracer of the photographs counts as 1.
Fronts, outlines and arrival times need no more. Amounts of tracer do.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.calibrating.plume_core import STRONG_SHARE, strong_signal
from porotwin_imaging.calibrating.stock_level import stock_levels
from porotwin_imaging.photo_to_map import LogRatioMap, compare_with_baseline
from porotwin_imaging.tracer.calibration import RELATIVE, Calibration, Response
from porotwin_imaging.tracer.tracer_signal import CHANNELS, TracerSignal, mean_absorbance

Array = NDArray[Any]


def relative_calibration(
    baseline: Baseline, photographs: Sequence[Callable[[], bytes]]
) -> Calibration:
    """Return the calibration that makes the core of the plume 1.

    Args:
        baseline: the baseline; its own calibration does not count.
        photographs: each returns the bytes of a photograph with tracer. One that cannot be used is
            left out.

    Raises:
        InputError: no photograph shows tracer.
    """
    compared: list[LogRatioMap] = []
    for read in photographs:
        with suppress(InputError):
            compared.append(compare_with_baseline(read(), baseline))
    grey = TracerSignal(weights=CHANNELS['grey'])
    strong = strong_signal([_signal(one, grey) for one in compared]) if compared else 0.0
    if strong <= 0.0:
        raise InputError(
            'relative scale: no photograph is darker than the baseline; give one that shows tracer'
        )
    signal = TracerSignal(weights=_weights(compared, grey, strong))
    signals = [_signal(one, signal) for one in compared]
    labels = np.zeros(signals[0].shape, np.uint8)
    found = stock_levels(signals, labels, [1.0] * len(signals))
    level = found.levels[0].level if found.levels else found.strong
    return Calibration(signal, Response((0.0, level), (0.0, 1.0)), made={'scale': RELATIVE})


def _signal(compared: LogRatioMap, signal: TracerSignal) -> Array:
    """Return the signal (nz, nx) of a photograph, NaN where it is hidden."""
    return np.where(compared.visible, signal.of(compared.log_ratio), np.nan)


def _weights(
    compared: Sequence[LogRatioMap], signal: TracerSignal, strong: float
) -> tuple[float, float, float]:
    """Return weights of the channels: each as the strong tracer absorbs its light."""
    cells = [one.log_ratio[_signal(one, signal) > STRONG_SHARE * strong] for one in compared]
    absorbed = np.maximum(mean_absorbance(np.concatenate(cells)), 0.0)
    red, green, blue = (float(share) for share in absorbed / absorbed.sum())
    return red, green, blue
