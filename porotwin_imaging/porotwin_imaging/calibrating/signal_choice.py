"""The choice of the signal: its contrast and its weights of red, green and blue.

A dye absorbs red, green and blue in fixed ratios. In the contrast that describes how its light is
lost, the signals of the channels are therefore proportional, from pale to stock. In the other
contrast their ratio changes. This needs no known concentration.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused
from porotwin_imaging.calibrating.plume_core import STRONG_SHARE
from porotwin_imaging.numerics.robust_statistics import NOISE_SPREADS, TOP_PERCENTILE
from porotwin_imaging.tracer.tracer_colour import FEWEST_CELLS, STRONG_HUE
from porotwin_imaging.tracer.tracer_signal import (
    Contrast,
    TracerSignal,
    learned_weights,
    mean_absorbance,
)


@dataclass(frozen=True)
class CalibrationSettings:
    """The calibration from photographs of an injection (`calibration_fit.py`)."""

    least_signal: float = 0.002
    """Smoothed signal below which there is no tracer, however even the background is [-]."""
    scale_error: float = 0.025
    """Relative standard deviation of a scale from the pump log [-]: an estimate."""


SIGNAL = CalibrationSettings()


Array = NDArray[Any]
Labels = NDArray[np.uint8]
Mask = NDArray[np.bool_]

_PALE, _DEEP = (0.2, 0.5), (0.8, 1.2)
"""Shares of the strong signal between which cells are pale, and full of tracer [-]."""
_SINGLE_CHANNELS = tuple(map(tuple, np.eye(3)))
"""Weights that take red, green and blue alone."""
_LEAST_SLOPE = 0.1
"""Channels that absorb less than this share of the red light do not tell the ratio."""
_CLEARLY_STRAIGHTER = 0.04
"""The difference is taken only if its colours bend less by this."""


@dataclass(frozen=True)
class SignalChoice:
    """The chosen signal.

    Attributes:
        signal: its definition.
        colour_bend: relative change of the ratio of the channels from pale to stock, by contrast;
            NaN if there are too few pale cells.
        line: a line for the operator.
    """

    signal: TracerSignal
    colour_bend: dict[str, float]
    line: str


def choose_signal(
    log_ratios: Sequence[Array],
    visible: Sequence[Mask],
    labels: Labels,
    contrast: Contrast | None = None,
) -> SignalChoice:
    """Return the signal that describes the tracer of these photographs best.

    Args:
        log_ratios: log ratio of each photograph to the baseline, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        labels: index of the sand in each cell, shape (nz, nx). Colours are compared in one sand.
        contrast: the contrast, None to choose it by the colours.

    Raises:
        CalibrationRefused: no photograph shows tracer.
    """
    ratios = np.concatenate([one[seen] for one, seen in zip(log_ratios, visible, strict=True)])
    strength = -ratios.mean(axis=1)
    strongest = float(np.percentile(strength, TOP_PERCENTILE))
    tracer = strength > STRONG_SHARE * strongest
    deviation = float(np.median(np.abs(strength - np.median(strength))))
    quiet = np.abs(strength) < NOISE_SPREADS * deviation + 1e-4
    if tracer.sum() < FEWEST_CELLS or strongest < STRONG_HUE:
        raise CalibrationRefused(
            'calibration: no photograph shows tracer; use ones of an injection with a dye that '
            'darkens the sand'
        )
    sand = np.concatenate([labels[seen] for seen in visible])
    main = sand == np.bincount(sand[tracer]).argmax()
    bends = {name: _colour_bend(name, ratios[main]) for name in get_args(Contrast)}
    chosen = contrast or _straighter(bends)
    weights = learned_weights(ratios[tracer], ratios[quiet])
    red, green, blue = weights
    reason = 'as asked' if contrast else _reason(bends)
    line = f'signal: {chosen} ({reason}), weights red {red:.2f}, green {green:.2f}, blue {blue:.2f}'
    signal = TracerSignal(chosen, weights, mean_absorbance(ratios[tracer]))
    return SignalChoice(signal, dict(bends), line)


def _straighter(bends: dict[Contrast, float]) -> Contrast:
    """Return the contrast whose channels keep their ratio; absorbance in doubt."""
    gain = bends['absorbance'] - bends['difference']
    return 'difference' if gain > _CLEARLY_STRAIGHTER else 'absorbance'


def _reason(bends: dict[Contrast, float]) -> str:
    """Return the reason of the choice in words."""
    if not np.isfinite(list(bends.values())).all():
        return 'too few pale cells to compare colours'
    words = ', '.join(f'{100 * bend:.0f} % in {name}' for name, bend in bends.items())
    return f'colours change from pale to stock by {words}'


def _colour_bend(contrast: Contrast, ratios: Array) -> float:
    """Return the relative change of the ratio of the channels from pale to full cells.

    The change is the mean over green and blue relative to red. `ratios`: log ratios of the cells of
    one sand, shape (n, 3).
    """
    red, green, blue = (TracerSignal(contrast, weights).of(ratios) for weights in _SINGLE_CHANNELS)
    strong = float(np.percentile(red, TOP_PERCENTILE))
    level = float(np.median(red[red > 0.5 * strong]))
    pale, full = ((red > low * level) & (red < high * level) for low, high in (_PALE, _DEEP))
    if min(pale.sum(), full.sum()) < FEWEST_CELLS:
        return float('nan')
    changes = [
        abs(np.log(max(_slope(red[pale], other[pale]), 1e-3) / _slope(red[full], other[full])))
        for other in (green, blue)
        if _slope(red[full], other[full]) > _LEAST_SLOPE
    ]
    return float(np.mean(changes)) if changes else float('nan')


def _slope(first: Array, second: Array) -> float:
    """Return the ratio of the medians of two signals."""
    return float(np.median(second) / np.median(first))
