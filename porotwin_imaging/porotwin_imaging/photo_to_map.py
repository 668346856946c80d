"""From a photograph to a map of tracer concentration: the order of the steps.

    baseline = make_baseline(rig, grid, [jpeg_bytes], calibration=load_calibration(path))
    found = concentration_map(jpeg_bytes, baseline)

| step | module |
| --- | --- |
| decode the file, no finer than needed | `photo_file` |
| align to the baseline | `alignment` |
| sample the cells | `sampling`, `cell_sums` |
| subtract the baseline | `baseline_subtraction` |
| check which sand is visible | `validity` |
| correct colours and light | `colour_correction`, `light_correction` |
| compute the signal and its concentration | `tracer_signal`, `calibration` |
| denoise | `denoising`, `total_variation`, `level_smoothing` |
| take the blur of the camera back | `front_sharpening` |
| correct fronts across a cell | `front_curvature` |
| estimate the deviation | `map_deviation`, `light_error` |

Both functions here are pure: the same photograph and baseline give the same result.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.baseline.baseline_subtraction import log_ratio_variance
from porotwin_imaging.baseline.photo_cells import Look, accept_all, log_ratio_below, photo_cells
from porotwin_imaging.baseline.validity import unclipped_cells, visible_cells
from porotwin_imaging.geometry.alignment import ALIGNMENT, Alignment, alignment_remarks
from porotwin_imaging.light.colour_correction import light_at_chart, light_beside
from porotwin_imaging.light.light_correction import corrected_light
from porotwin_imaging.light.light_drift import LightDrift
from porotwin_imaging.numerics.row_bands import by_bands
from porotwin_imaging.numerics.stopwatch import Stopwatch
from porotwin_imaging.smoothing.denoising import denoised
from porotwin_imaging.smoothing.front_sharpening import SHARPENING, blur_in_cells, sharpened
from porotwin_imaging.smoothing.level_smoothing import smooth_along_levels
from porotwin_imaging.smoothing.map_deviation import NOISE, map_deviation
from porotwin_imaging.tracer.front_curvature import without_curvature
from porotwin_imaging.tracer.light_error import SeenTracer, light_error

Array = NDArray[Any]


@dataclass(frozen=True)
class ConcentrationMap:
    """A map of tracer concentration from one photograph.

    Attributes:
        values: concentration, float32, shape (nz, nx), row 0 at the bottom, 1 = tracer stock, NaN
            where the photograph does not show the sand.
        deviation: standard deviation of `values`, same shape.
        systematic: the part of it that stays the same from photograph to photograph, same shape.
        calibrated: False if the scale is only a default.
        suspicious: True if a person should check the map.
        status: remarks, one line each.
        timings: duration of each stage [s].
        alignment: movement of the camera since the baseline.
    """

    values: NDArray[np.float32]
    deviation: NDArray[np.float32]
    systematic: NDArray[np.float32]
    calibrated: bool
    suspicious: bool
    status: list[str]
    timings: dict[str, float]
    alignment: Alignment

    @property
    def typical_noise(self) -> float:
        """Median of the random deviation of the visible cells [-]; NaN if no cell is visible."""
        known = np.isfinite(self.deviation)
        if not known.any():
            return math.nan
        variance = self.deviation[known] ** 2 - self.systematic[known] ** 2
        return float(np.sqrt(max(np.median(variance), 0.0)))


@dataclass(frozen=True)
class LogRatioMap:
    """A photograph relative to the baseline, before any scaling.

    Attributes:
        log_ratio: log of light relative to the baseline without the drift of light, shape (nz, nx,
            3 = red, green, blue).
        variance: variance of `log_ratio` from noise, same shape.
        light_variance: variance of the local light that was removed, shape (nz, nx).
        visible: cells that show their sand, shape (nz, nx).
        drift: the drift of light that was removed.
        alignment: movement of the camera since the baseline.
        remarks: one line each.
        suspicious: True if a person should check the photograph.
    """

    log_ratio: Array
    variance: Array
    light_variance: Array
    visible: NDArray[np.bool_]
    drift: LightDrift
    alignment: Alignment
    remarks: list[str]
    suspicious: bool


def concentration_map(data: bytes, baseline: Baseline, look: Look = accept_all) -> ConcentrationMap:
    """Return the map of the photograph `data` (bytes of the file), which `look` may refuse.

    Raises:
        InputError: the photograph cannot be used; one line gives the reason.
    """
    watch = Stopwatch()
    compared = compare_with_baseline(data, baseline, watch, look)
    with watch.stage('signal'):
        concentration, noise = _concentration(compared, baseline)
    with watch.stage('denoise'):
        values = denoised(concentration, noise, compared.visible, baseline.grid)
        smoothed = smooth_along_levels(concentration, noise, values, baseline.grid.dx)
        sharp = sharpened(smoothed, _blur(baseline))
        straight = without_curvature(
            sharp.values, baseline.calibration, baseline.sampling.samples_across
        )
        sharp = replace(sharp, values=straight)
        seen = SeenTracer(
            compared.log_ratio, compared.light_variance, baseline.sand_factors, sharp.values
        )
        wrong_light = light_error(seen, baseline.calibration)
        deviation = map_deviation(sharp, wrong_light, baseline.calibration, baseline.grid)
    scale = (
        'relative scale' if baseline.calibration.is_relative else 'uncalibrated: default scaling'
    )
    uncalibrated = [] if baseline.calibrated else [scale]
    return ConcentrationMap(
        values=sharp.values.astype(np.float32),
        deviation=deviation.total.astype(np.float32),
        systematic=deviation.systematic.astype(np.float32),
        calibrated=baseline.calibrated,
        suspicious=compared.suspicious,
        status=uncalibrated + compared.remarks,
        timings=watch.timings,
        alignment=compared.alignment,
    )


def compare_with_baseline(
    data: bytes, baseline: Baseline, watch: Stopwatch | None = None, look: Look = accept_all
) -> LogRatioMap:
    """Return the photograph `data` (bytes of the file) relative to the baseline.

    The calibration starts from this. `watch` collects the duration of each stage. `look` may refuse
    the decoded photograph.

    Raises:
        InputError: the photograph cannot be used; one line gives the reason.
    """
    watch = watch or Stopwatch()
    sampling = baseline.sampling
    cells = photo_cells(data, baseline, watch, look)
    pixels, alignment, sums = cells.pixels, cells.alignment, cells.sums
    with watch.stage('average'):
        ratio = sums.log_ratio
        variance = log_ratio_variance(sums, baseline.chart.matrix, sampling.samples_across)
        unclipped, clipped_remarks = unclipped_cells(sums, cells.share)
        visible, hidden_remarks = visible_cells(sums, print_or_scan=alignment.print_or_scan)
        visible &= unclipped
    with watch.stage('light'):
        chart_light, chart_remarks = light_at_chart(pixels, alignment.homography, baseline.chart)
        light = corrected_light(
            ratio,
            visible,
            sums.share,
            sums.blocks,
            chart_light,
            baseline.calibration.signal.tracer_colour,
            partial(log_ratio_below, cells=cells, baseline=baseline),
            beside=light_beside(pixels, alignment.homography, baseline.chart),
        )
    left_out = [*cells.remarks, *clipped_remarks, *hidden_remarks, *light.left_out]
    deformed = alignment.residual > ALIGNMENT.closure_px
    moved_remarks = alignment_remarks(alignment, baseline.reduction)
    return LogRatioMap(
        log_ratio=light.log_ratio,
        variance=variance + baseline.fluctuation,
        light_variance=light.variance,
        visible=light.comparable,
        drift=light.drift,
        alignment=alignment,
        remarks=moved_remarks + chart_remarks + light.remarks + left_out,
        suspicious=deformed or bool(left_out),
    )


def _blur(baseline: Baseline) -> tuple[float, float]:
    """Return the blur of a photograph, up and across [cells]."""
    measured = baseline.calibration.blur_px
    blur_px = SHARPENING.blur_px if measured is None else measured
    return blur_in_cells(baseline.sampling.pixels_per_cell, baseline.reduction, blur_px)


def _concentration(compared: LogRatioMap, baseline: Baseline) -> tuple[Array, Array]:
    """Return the raw concentration (nz, nx), NaN where it is hidden, and its standard deviation."""
    calibration = baseline.calibration
    lowest, highest = NOISE.credible

    def band(
        log_ratio: Array, variance: Array, visible: Array, factors: Array
    ) -> tuple[Array, Array]:
        signal = calibration.signal.of(log_ratio) * factors
        noise = calibration.signal.noise(log_ratio, variance)
        raw = np.clip(calibration.response.concentration_of(signal), lowest, highest)
        return (
            np.where(visible, raw, np.nan).astype(np.float32),
            (noise * factors * calibration.response.slope_at(signal)).astype(np.float32),
        )

    concentration, noise = by_bands(
        band, compared.log_ratio, compared.variance, compared.visible, baseline.sand_factors
    )
    return concentration, noise
