"""Checks whether the light of a photograph can be compared with its baseline.

Tracer darkens sand and never brightens it. Cells that stay brighter than the baseline after the
drift of light was removed show a reflection, a flash or another exposure. A plume there would look
paler than it is, or vanish, so these cells have no value.

A photograph with another exposure needs the colour chart, or places that never change. A rig that
names neither is compared on most of its sand, if the frame beside it agrees.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.light.colour_checker import ChartLight
from porotwin_imaging.light.light_drift import LIGHT, LightDrift, light_drift
from porotwin_imaging.numerics.robust_statistics import TOP_PERCENTILE
from porotwin_imaging.tracer.tracer_signal import TracerSignal

Array = NDArray[Any]
Mask = NDArray[np.bool_]

SMALLEST_WINDOW = 3
"""Cells across the window of averaged light: one cell is noise."""
REACH = np.ones((5, 5), np.uint8)
"""Cells across the surroundings of brighter or foreign cells that are left out as well."""
_GREY = np.full((1, 3), 1 / 3, np.float32)
"""Mean of red, green and blue; OpenCV takes it six times faster than numpy."""
_LEAST_COLOUR = 0.02
"""Mean difference of the channels, relative to the light, below which a photograph is grey."""
_MOST_GREY_DIFFERENCE = 1
"""Largest difference of the channels in a grey photograph [grey levels]. It is 0 in a grey JPEG,
and more for white sand: noise of the sensor colours it."""


def lit_as_baseline(
    residual: Array,
    visible: Mask,
    scatter: float,
) -> tuple[Mask, list[str]]:
    """Return the visible cells (nz, nx) that are not brighter than the baseline, and remarks.

    Args:
        residual: log ratio to the baseline without the drift of light, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        scatter: by how much places of the same light differ between the two photographs [log].
    """
    smooth = cv2.transform(window_mean(residual, visible), _GREY)
    brighter = visible & (smooth > LIGHT.most_brighter + scatter)
    if not brighter.any():
        return visible, []
    left_out = cv2.dilate(brighter.astype(np.uint8), REACH) > 0
    lost = float((left_out & visible).sum() / max(1, visible.sum()))
    remark = f'{100 * lost:.1f} % of the sand is near a reflection or lamp: left out'
    return visible & ~left_out, [remark]


def spilled_light(residual: Array, bright: Mask, after: Array) -> Array:
    """Return the error of log ratios (nz, nx) beside a reflection: its light fades, not ends.

    Dark tracer hides it: a little light is no brighter than the baseline there. With the light a
    that the reflection adds where it is found, and the distance d from there, the error is

        a exp(-d^2 / (2 s^2)) / after,    s = sqrt(found cells) / 4.

    Args:
        residual: log ratio to the baseline without the drift of light, shape (nz, nx, 3).
        bright: cells where the reflection was found, shape (nz, nx).
        after: linear light of the photograph, shape (nz, nx, 3).
    """
    light = after.mean(axis=2)
    added = float(np.median((light * (1.0 - np.exp(-residual.mean(axis=2))))[bright]))
    away = cv2.distanceTransform((~bright).astype(np.uint8), cv2.DIST_L2, 5)
    reach = 0.25 * float(np.sqrt(bright.sum()))
    return np.asarray(added * np.exp(-0.5 * (away / reach) ** 2) / light, np.float32)


def window_mean(residual: Array, visible: Mask, size: int = SMALLEST_WINDOW) -> Array:
    """Return the mean of `residual` (nz, nx, 3) over the visible cells of windows `size` across."""
    weight = cv2.blur(visible.astype(np.float32), (size, size))
    filled = np.where(visible[..., None], residual, np.float32(0.0)).astype(np.float32)
    smooth = cv2.blur(filled, (size, size))
    return np.asarray(smooth / np.maximum(weight, 1.0 / size**2)[..., None])


def refuse_unknown_light(
    log_ratio: Array, visible: Mask, drift: LightDrift, *, chart_seen: bool
) -> None:
    """Refuse a photograph whose light neither the colour chart nor sand without tracer shows.

    Args:
        log_ratio: log ratio to the baseline, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        drift: the drift of light that was found.
        chart_seen: whether the colour chart was found.

    Raises:
        InputError: the light is unknown.
    """
    if chart_seen or drift.background > 0.0 or not visible.any():
        return
    factor = float(np.exp(np.median(log_ratio[visible].mean(axis=1))))
    raise InputError(
        f'photograph has {factor:.2g} times the light of its baseline and the colour chart is not '
        'seen, so tracer cannot be told from light; set exposure and lamps as for the baseline'
    )


def exposure_remarks(light: ChartLight) -> list[str]:
    """Return a remark if the chart or other places corrected another exposure."""
    if abs(float(light.straight_gain.mean())) <= LIGHT.search_range:
        return []
    factor = float(np.exp(light.straight_gain.mean()))
    return [f'{factor:.2g} times the light of the baseline: corrected by {light.told_by}']


def light_of_most_sand(
    log_ratio: Array, visible: Mask, beside: ChartLight
) -> tuple[Array | None, list[str]]:
    """Return the log gain (3,) of most of the sand if it is another exposure, and a remark.

    Tracer could darken most of the sand alike. So the picture beside the sand must agree.

    Args:
        log_ratio: log ratio to the baseline, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        beside: light beside the sand.
    """
    if not visible.any() or light_drift(log_ratio, visible, None).background > 0.0:
        return None, []
    gain = np.median(log_ratio[visible], axis=0)
    apart = abs(float((gain - beside.log_gain).mean()))
    if apart > LIGHT.search_range or light_drift(log_ratio, visible, gain).background == 0.0:
        return None, []
    factor = float(np.exp(gain.mean()))
    return gain, [
        f'{factor:.2g} times the light of the baseline on most of the sand, and about so much '
        'beside it: corrected by sand that seems to hold no tracer; name places that never change '
        'in camera.references_px'
    ]


def drift_remarks(drift: LightDrift, visible: Mask) -> list[str]:
    """Return remarks on light of another slope or colour: the drift takes up all but a little.

    Args:
        drift: the drift of light that was removed.
        visible: cells that show their sand, shape (nz, nx).
    """
    if not visible.any():
        return []
    remarks = []
    dimmest, brightest = np.percentile(
        drift.shape[visible], (100.0 - TOP_PERCENTILE, TOP_PERCENTILE)
    )
    if brightest - dimmest > LIGHT.search_range:
        remarks.append(
            f'a part of the rig has {float(np.exp(dimmest - brightest)):.2g} times the light of '
            'another part, compared with the baseline: corrected, but pale tracer is less certain; '
            'set the lamps as for the baseline'
        )
    if np.ptp(drift.channels) > LIGHT.most_brighter:
        red, _, blue = np.exp(drift.channels - drift.channels[1])
        remarks.append(
            f'beside green, red is {red:.2f} and blue {blue:.2f} times as bright as in the '
            'baseline: corrected, but pale tracer is less certain; set a fixed white balance '
            'and the lamps as for the baseline'
        )
    return remarks


def refuse_grey(state: Array, baseline: Array) -> None:
    """Raise InputError if the photograph has no colours but the baseline has.

    `state` and `baseline` are linear light of the cells, shape (nz, nx, 3).
    """
    if _colour(state) < _LEAST_COLOUR < _colour(baseline) / 2:
        raise InputError(
            'photograph is grey, its baseline coloured; set the camera to colour again'
        )


def refuse_grey_baseline(pixels: NDArray[np.uint8], signal: TracerSignal) -> None:
    """Refuse a baseline without colours if the calibration has seen coloured photographs.

    The calibration tells tracer from shadow by its colour. In grey photographs all tracer would
    count as shadow. A calibration made of grey photographs, or of a grey dye, knows no colour.

    Args:
        pixels: decoded baseline, blue-green-red, shape (rows, columns, 3).
        signal: the signal of the calibration.

    Raises:
        InputError: the photograph is grey, the calibration coloured.
    """
    if signal.tracer_colour is None:
        return
    difference = pixels.max(axis=2) - pixels.min(axis=2)
    if float(np.percentile(difference, TOP_PERCENTILE)) <= _MOST_GREY_DIFFERENCE:
        raise InputError(
            'photographs are grey, but the calibration is of coloured ones: set the camera to '
            'colour again, or calibrate with grey photographs'
        )


def _colour(light: Array) -> float:
    """Return the mean difference between the channels, relative to the light."""
    mean = float(light.mean())
    return float(np.ptp(light, axis=2).mean()) / mean if mean > 0 else 0.0
