"""The calibration of a camera and rig from a baseline and photographs of an injection.

The steps: colours and light are corrected, the weights of red, green and blue are chosen, sands are
segmented and their signals made continuous, and the signal is scaled to the injected mass. Without
a pump log the strongest signal is taken for tracer stock.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule
from porotwin_imaging import sands
from porotwin_imaging.baseline import Baseline, make_baseline
from porotwin_imaging.calibration import Calibration, Labels, Response
from porotwin_imaging.mass_balance_fit import (
    LinearGrowth,
    fit_growth,
    fit_response,
    injected_volume,
)
from porotwin_imaging.photo_to_map import LogRatioMap, compare_with_baseline
from porotwin_imaging.robust_statistics import SPREAD_PER_DEVIATION
from porotwin_imaging.settings import DEFAULTS, CalibrationSettings, ImagingSettings
from porotwin_imaging.tracer_signal import CHANNELS, TracerSignal, learned_weights, mean_absorbance

Array = NDArray[Any]

_STRONG_PERCENTILE = 99.9
"""Percentile of the log ratios that is the strongest signal; single cells may be noise."""
_QUIET_SPREADS = 4
"""Cells within this many median absolute deviations are background."""
_TRACER_SPREADS, _TRACER_SIGMA, _TRACER_MARGIN = 4, 3, (9, 9)
"""Cells with tracer: spreads above the background, blur and margin around them [cells]."""
_TOP_SHARE = 0.3
"""Without a pump log, stock is a percentile of the signals above this share of the largest."""


@dataclass(frozen=True)
class CalibrationFit:
    """A calibration and the data that it was fitted to.

    Attributes:
        calibration: the result.
        lines: a summary for the operator, one line per step.
        growth: linear fit to the pump log, None without one.
        times: times of the photographs that were used [s].
        injected: volume of stock injected until each photograph [m^3]; empty without a pump log.
        imaged: volume of stock in each photograph according to the calibration [m^3].
        baseline: the baseline on the grid of the calibration.
        baseline_photo: the first baseline photograph (bytes of the file).
        sands: index of the sand in each cell, shape (nz, nx).
        signals: signal times sand factor of each photograph, shape (nz, nx).
    """

    calibration: Calibration
    lines: list[str]
    growth: LinearGrowth | None
    times: list[float]
    injected: list[float]
    imaged: list[float]
    baseline: Baseline
    baseline_photo: bytes
    sands: Labels
    signals: list[Array]


def fit_calibration(
    rig: Rig,
    baselines: Sequence[bytes],
    states: Sequence[tuple[float, bytes]],
    *,
    schedule: Schedule | None = None,
    source: str = '',
    progress: Callable[[str], None] = lambda _: None,
    settings: ImagingSettings = DEFAULTS,
) -> CalibrationFit:
    """Return the calibration of a camera and rig.

    `calibration_pictures.write_fit` writes the file and a picture of every step.

    Args:
        rig: the rig with its camera.
        baselines: photographs without tracer (bytes of the files).
        states: exposure time [s] and bytes of the photographs of the injection.
        schedule: injected rates in the time of the photographs, None if they are unknown.
        source: name of the experiment, for the file.
        progress: called with a line for each photograph.
        settings: settings of all steps.

    Raises:
        InputError: no photograph can be used, none shows tracer, or the signal does not grow with
            the pump log.
    """
    grid = _calibration_grid(rig, settings.calibration)
    baseline = make_baseline(rig, grid, baselines, settings=settings)
    lines = list(baseline.remarks)
    compared, times = _compare_all(baseline, states, lines, progress)
    signal = _choose_signal(compared, lines, settings.calibration)
    labels = sands.segment(*baseline.sand_appearance(), compared[0].visible, settings.sands)
    raw = [np.where(one.visible, signal.of(one.log_ratio), np.nan) for one in compared]
    factors = sands.fit_factors(raw, labels, settings.sands)
    lines.append(_sand_line(factors))
    signals = [plane * np.array(factors.values)[labels] for plane in raw]
    volume = rig.cell_pore_volume(grid)
    response, growth, injected = _scale(volume, signals, times, schedule, lines, settings)
    calibration = Calibration(
        signal,
        response,
        np.ascontiguousarray(labels[::-1]) if len(factors.values) > 1 else None,
        factors.values,
        made=_origin(source, len(compared), growth),
        scale_error=_scale_error(growth, settings.calibration),
    )
    imaged = [
        float(np.nansum(np.clip(response.concentration_of(plane), 0, 1) * volume))
        for plane in signals
    ]
    if injected:
        lines.append(seen_mass_line(injected, imaged))
    return CalibrationFit(
        calibration=calibration,
        lines=lines,
        growth=growth,
        times=times,
        injected=injected,
        imaged=imaged,
        baseline=baseline,
        baseline_photo=baselines[0],
        sands=labels,
        signals=signals,
    )


def seen_mass_line(injected: Sequence[float], imaged: Sequence[float]) -> str:
    """Return how far the tracer in all maps [m^3] is from the injected tracer [m^3].

    Distances are relative to the largest injected volume.
    """
    apart = np.abs(np.subtract(imaged, injected)) / max(injected)
    return (
        f'mass in the maps of all {len(apart)} photographs: {100 * np.median(apart):.1f} % off in '
        f'the median, {100 * apart.max():.1f} % at most'
    )


def _calibration_grid(rig: Rig, settings: CalibrationSettings) -> Grid:
    """Return a grid of nearly square cells."""
    columns = settings.columns
    return rig.grid(columns, max(1, round(columns * rig.height_m / rig.width_m)))


def _origin(source: str, photographs: int, growth: LinearGrowth | None) -> dict[str, Any]:
    """Return the entry `made` of the calibration file."""
    return {
        'by': 'porotwin calibrate',
        'from': source,
        'photographs': photographs,
        'outliers': 0 if growth is None else int((~growth.inliers).sum()),
        'scale': 'pump log' if growth is not None else 'strongest signal taken for stock',
        'mass_misfit': None if growth is None else round(growth.misfit, 4),
    }


def _scale_error(growth: LinearGrowth | None, settings: CalibrationSettings) -> float:
    """Return the relative standard deviation of the scale."""
    if growth is None:
        return settings.scale_error_without_log
    return max(settings.scale_error, growth.misfit)


def _compare_all(
    baseline: Baseline,
    states: Sequence[tuple[float, bytes]],
    lines: list[str],
    progress: Callable[[str], None],
) -> tuple[list[LogRatioMap], list[float]]:
    """Return the usable photographs relative to the baseline, in the order of time, and times.

    Remarks are appended to `lines`.
    """
    compared, times = [], []
    for time, data in sorted(states, key=lambda state: state[0]):
        progress(f'photograph at {time:g} s')
        try:
            found = compare_with_baseline(data, baseline)
        except InputError as error:
            lines.append(f'photograph at {time:g} s left out: {error}')
            continue
        lines += [f'photograph at {time:g} s: {remark}' for remark in found.remarks]
        compared.append(found)
        times.append(time)
    if not compared:
        raise InputError('calibration: no photograph of the injection can be used')
    return compared, times


def _choose_signal(
    compared: list[LogRatioMap], lines: list[str], settings: CalibrationSettings
) -> TracerSignal:
    """Return the signal whose weights separate tracer best from the background."""
    ratios = np.concatenate([one.log_ratio[one.visible] for one in compared])
    strength = -ratios.mean(axis=1)
    strongest = np.percentile(strength, _STRONG_PERCENTILE)
    tracer = strength > settings.tracer_share * strongest
    deviation = np.median(np.abs(strength - np.median(strength)))
    quiet = np.abs(strength) < _QUIET_SPREADS * deviation + 1e-4
    if tracer.sum() < settings.fewest_tracer_cells or strongest < settings.least_log_ratio:
        raise InputError('calibration: no photograph shows tracer; use ones of an injection')
    candidates = {name: TracerSignal('difference', weights) for name, weights in CHANNELS.items()}
    weights = learned_weights(ratios[tracer], ratios[quiet])
    candidates['learned'] = TracerSignal('difference', weights)
    clarity = {
        name: _clarity(signal.of(ratios[tracer]), signal.of(ratios[quiet]))
        for name, signal in candidates.items()
    }
    name = max(candidates, key=lambda key: clarity[key])
    red, green, blue = candidates[name].weights
    lines.append(
        f'signal: {name} (red {red:.2f}, green {green:.2f}, blue {blue:.2f}); '
        f'signal-to-noise ratio {clarity[name]:.0f}'
    )
    return replace(candidates[name], absorbance=mean_absorbance(ratios[tracer]))


def _clarity(tracer: Array, background: Array) -> float:
    """Return the median signal of tracer over the spread of the background.

    Two small terms in the divisor prefer signals that are also even within the tracer.
    """
    return float(np.median(tracer) / (background.std() + 0.002 + 0.05 * tracer.std()))


def _sand_line(factors: sands.SandFactors) -> str:
    """Return the line of the summary about sands."""
    if len(factors.values) == 1:
        return 'sands: one'
    words = ', '.join(f'{value:.2f}' for value in factors.values)
    return (
        f'sands: {len(factors.values)}, factors {words}; median jump over their interfaces '
        f'{100 * factors.jump_before:.0f} % before, {100 * factors.jump_after:.0f} % after'
    )


def _only_tracer(signal: Array, settings: CalibrationSettings) -> Array:
    """Return the signal (nz, nx), 0 away from tracer and where nothing is visible.

    The many cells without tracer would add the small error of the light to the mass.
    """
    filled = np.nan_to_num(signal).astype(np.float32)
    smooth = cv2.GaussianBlur(filled, (0, 0), _TRACER_SIGMA)
    spread = SPREAD_PER_DEVIATION * float(np.median(np.abs(smooth - np.median(smooth))))
    tracer = (smooth > _TRACER_SPREADS * spread + settings.least_signal).astype(np.uint8)
    return np.where(cv2.dilate(tracer, np.ones(_TRACER_MARGIN, np.uint8)) > 0, filled, 0.0)


def _scale(
    volume: Array,
    signals: list[Array],
    times: list[float],
    schedule: Schedule | None,
    lines: list[str],
    settings: ImagingSettings,
) -> tuple[Response, LinearGrowth | None, list[float]]:
    """Return the response, the linear growth if there is a pump log, and injected volumes [m^3].

    `volume` (nz, nx) is the pore volume of the cells [m^3].
    """
    if schedule is None or not schedule.rows:
        return _scale_without_log(signals, lines, settings.calibration), None, []
    start = min(row.time for row in schedule.rows)
    injected = [injected_volume(schedule, min(start, time), time) for time in times]
    tracer = [_only_tracer(plane, settings.calibration) for plane in signals]
    integrals = [float((plane * volume).sum()) for plane in tracer]
    growth = fit_growth(integrals, injected, settings.mass_balance)
    used = np.flatnonzero(growth.inliers)
    response, misfit = fit_response(
        [tracer[i] for i in used],
        volume,
        [injected[i] for i in used],
        scale=growth.scale,
        settings=settings.mass_balance,
    )
    lines.append(
        f'scale: {len(used)} of {len(times)} photographs follow the pump log; mass misfit '
        f'{100 * growth.misfit:.1f} % straight, {100 * misfit:.1f} % with the monotone curve'
    )
    return response, replace(growth, misfit=misfit), injected


def _scale_without_log(
    signals: list[Array], lines: list[str], settings: CalibrationSettings
) -> Response:
    """Return a linear response that takes the strongest signal for tracer stock."""
    strong = np.concatenate([s[s > _TOP_SHARE * np.nanmax(s)] for s in signals])
    top = float(np.nanpercentile(strong, settings.stock_percentile))
    lines.append(f'no pump log: the strongest signal, {top:.3f}, is taken for tracer stock')
    return Response((0.0, top), (0.0, 1.0))
