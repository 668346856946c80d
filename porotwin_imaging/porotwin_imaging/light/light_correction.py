"""The light of a photograph: its correction, and the cells that compare with the baseline.

A change of tone is undone (`tone_change.py`), the drift of light is removed (`light_drift.py`),
then soft shadows (`local_light.py`). The rest must be tracer: cells that are brighter
(`light_check.py`) or have another colour (`foreign_signal.py`) have no value.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.geometry.frame import VALIDITY, visible_means
from porotwin_imaging.geometry.sampling import SAMPLING
from porotwin_imaging.light.colour_checker import ChartLight
from porotwin_imaging.light.foreign_signal import without_foreign_signal
from porotwin_imaging.light.light_check import (
    drift_remarks,
    exposure_remarks,
    light_of_most_sand,
    lit_as_baseline,
    refuse_unknown_light,
    spilled_light,
)
from porotwin_imaging.light.light_drift import LIGHT, LightDrift, light_drift
from porotwin_imaging.light.local_light import local_light
from porotwin_imaging.light.tone_change import haze_of_chart, tone_change, tone_of_chart
from porotwin_imaging.numerics.cell_sums import LEAST_LIGHT, BlockSums
from porotwin_imaging.numerics.channels import channel_mean
from porotwin_imaging.tracer.tracer_colour import TracerColour, colour_in

Array = NDArray[Any]
Mask = NDArray[np.bool_]

BelowVeil = Callable[[tuple[float, float, float]], Array]
"""Returns the log ratios (nz, nx, 3) without a veil of this linear red, green and blue."""

_TONE_ERRORS = {'curve': 0.02, 'haze': 0.03}
"""Standard deviation of a log ratio after a change of tone, relative to it: measured [-]. Where
stock leaves little light, a small error of the haze counts."""


@dataclass(frozen=True)
class CorrectedLight:
    """Log ratios to the baseline without the changes of light.

    Attributes:
        log_ratio: log ratios, shape (nz, nx, 3).
        variance: variance that the correction adds, shape (nz, nx), or (1, 1) if it adds none.
        comparable: visible cells whose change tracer can make, shape (nz, nx).
        drift: all changes of light that were removed.
        remarks: one line on each correction.
        left_out: one line on each fault that could not be corrected, or not surely.
    """

    log_ratio: Array
    variance: Array
    comparable: Mask
    drift: LightDrift
    remarks: list[str]
    left_out: list[str]


def corrected_light(
    log_ratio: Array,
    visible: Mask,
    share: Array,
    sums: BlockSums,
    chart_light: ChartLight | None,
    colour: TracerColour | None,
    below_veil: BelowVeil | None = None,
    *,
    beside: ChartLight | None = None,
) -> CorrectedLight:
    """Return log ratios without the changes of light.

    Args:
        log_ratio: log ratio of photograph to baseline, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        share: usable share of each cell, shape (nz, nx).
        sums: means of the baseline over blocks of cells.
        chart_light: light at the colour chart, or None.
        colour: colour of the tracer from the calibration; if None, the photograph is asked.
        below_veil: takes haze from the samples of the photograph; None: from means of cells.
        beside: light beside the sand of a rig that names neither a chart nor other places; it may
            confirm that most of the sand tells another exposure.

    Raises:
        InputError: the light cannot be compared with the baseline.
    """
    variance: Array = np.zeros((1, 1), np.float32)
    blocks, seen = _blocks(log_ratio, visible)
    before, after = (_light(light, sums, seen.shape) for light in (sums.baseline, sums.state))
    checker_gain = None if chart_light is None else chart_light.straight_gain
    scatter = 0.0 if chart_light is None else chart_light.scatter
    by_sand: list[str] = []
    if beside is not None and chart_light is None:
        checker_gain, by_sand = light_of_most_sand(blocks, seen, beside)
    tone = None if chart_light is None else tone_of_chart(chart_light)
    even = scatter <= LIGHT.tolerance  # otherwise neither a tone nor a hue can be told
    if tone is None and even:
        tone = tone_change(blocks, before, after, seen, checker_gain)
    remarks = [] if chart_light is None else exposure_remarks(chart_light)
    if tone is None and chart_light is not None:
        tone = haze_of_chart(chart_light, blocks, before, seen)
    if tone is not None:
        if tone.veil is not None and below_veil is not None:
            log_ratio = below_veil(tone.veil)
        else:
            log_ratio = tone.undone(log_ratio, _light(sums.baseline, sums, share.shape))
        blocks, seen = _blocks(log_ratio, visible)
        remarks.append(tone.remark)
        variance = (_TONE_ERRORS[tone.kind] * channel_mean(log_ratio)) ** 2
    drift = light_drift(log_ratio, np.where(visible, share, 0.0), checker_gain, scatter=scatter)
    refuse_unknown_light(log_ratio, visible, drift, chart_seen=checker_gain is not None)
    remarks += drift_remarks(drift, visible)
    residual = blocks - drift.channels - _resized(drift.shape, seen.shape)[..., None]
    colour = colour or (colour_in(residual, seen) if even else None)
    local = local_light(residual, seen, colour)
    if local is not None:
        residual = residual - local.log_gain[..., None]
        drift = replace(drift, shape=drift.shape + _resized(local.log_gain, visible.shape))
        variance = variance + _resized(local.variance, visible.shape)
        remarks += local.remarks
    comparable, bright = lit_as_baseline(residual, seen, scatter)
    if (found := seen & ~comparable).any():
        variance = variance + _resized(spilled_light(residual, found, after) ** 2, visible.shape)
    comparable, foreign = without_foreign_signal(residual, comparable, colour, scatter)
    _refuse_much_left_out(seen, comparable)
    left_out = _resized((seen & ~comparable).astype(np.float32), visible.shape) > 0
    return CorrectedLight(
        log_ratio=drift.removed_from(log_ratio),
        variance=variance,
        comparable=visible & ~left_out,
        drift=drift,
        remarks=remarks,
        left_out=[*by_sand, *bright, *foreign],
    )


def _refuse_much_left_out(seen: Mask, comparable: Mask) -> None:
    """Raise InputError if reflections and other colours hide too much of the sand."""
    lost = float((seen & ~comparable).sum() / max(1, seen.sum()))
    if lost > VALIDITY.most_left_out:
        raise InputError(
            'photograph is brighter than its baseline, or has colours that tracer cannot make, '
            f'on or near {100 * lost:.0f} % of the sand: another exposure, lamp, dye or fluid, '
            'gas, or a shadow or tracer on the baseline; set exposure and lamps as for the '
            'baseline, or take a baseline and a calibration of this fluid and light'
        )


def _blocks(log_ratio: Array, visible: Mask) -> tuple[Array, Mask]:
    """Return the mean log ratio of blocks of cells (rows, columns, 3), and which show sand.

    The cells of a coarse map are its blocks.
    """
    nz, nx = visible.shape
    most = SAMPLING.judged_columns
    if nx <= most:
        return log_ratio, visible
    means, share = visible_means(log_ratio, visible, (max(1, round(nz * most / nx)), most))
    return means, share > VALIDITY.least_visible_share


def _light(plane: Array, sums: BlockSums, shape: tuple[int, int]) -> Array:
    """Return the linear light of a plane of `sums` at `shape`, with channels."""
    light = plane / np.maximum(sums.share, VALIDITY.least_visible_share)[..., None]
    return np.maximum(_resized(light, shape), LEAST_LIGHT)


def _resized(plane: Array, shape: tuple[int, int]) -> Array:
    """Return a plane at another `shape`, interpolated."""
    if plane.shape[:2] == shape:
        return plane
    return np.asarray(cv2.resize(plane, shape[::-1], interpolation=cv2.INTER_LINEAR))
