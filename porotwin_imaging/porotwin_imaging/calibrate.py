"""The one calibration of a camera and rig, from a baseline and photographs of an injection.

Step by step: colours and light are matched, the weights of red, green and blue are learned from
where tracer shows, sands are told apart and made continuous, and the signal is scaled to what the
pumps injected. Without a pump log the strongest signal is taken for tracer stock.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule
from porotwin_imaging import calibration_pictures, sands
from porotwin_imaging.calibration import Calibration, Response, save_calibration
from porotwin_imaging.chain import Imaging, Measurement
from porotwin_imaging.injection import Growth, fit_growth, fit_response, injected_volume
from porotwin_imaging.tracer_signal import CHANNELS, Signal, learned_weights

Array = NDArray[Any]

COLUMNS = 400
"""Cells across the rig during calibration; also the size of the picture of sands."""
STRONGEST_SHARE = 0.3
"""Cells above this share of the strongest signal count as tracer when weights are learned."""
FEWEST_TRACER_CELLS = 30
LEAST_SIGNAL = 0.002
"""Smooth signal below which there is no tracer, however even the background."""
SCALE_ERROR = 0.025
"""Relative error of a scale from the pump log: what a curve that is fitted to masses leaves."""
SCALE_ERROR_STOCK = 0.1
"""Relative error of a scale that takes the strongest signal for stock."""


@dataclass(frozen=True)
class Calibrated:
    """A calibration and how it came about: `lines` to tell, `growth` None without a pump log.

    `times` [s], `injected` [m^3] and `seen` [m^3] of the photographs that were used.
    """

    calibration: Calibration
    lines: list[str]
    growth: Growth | None
    times: list[float]
    injected: list[float]
    seen: list[float]


def calibrate(
    rig: Rig,
    baselines: Sequence[bytes],
    states: Sequence[tuple[float, bytes]],
    *,
    schedule: Schedule | None = None,
    output: Path | None = None,
    source: str = '',
    progress: Callable[[str], None] = lambda _: None,
) -> Calibrated:
    """Return the calibration from `baselines` and `states` (exposure time [s], file's bytes).

    `schedule`: what the pumps injected, in the photographs' time; None when it is not known. With
    an `output` folder, calibration.yaml and a picture of every step are written there. `source`
    names the experiment in the file.

    Raises:
        InputError: photographs cannot be used, or show no tracer, or their growth does not follow
            the pump log.
    """
    grid = _grid(rig)
    imaging = Imaging(rig, grid)
    lines = imaging.set_baselines(baselines)
    measured, times = _measure_all(imaging, states, lines, progress)
    signal = _choose_signal(measured, lines)
    labels = sands.segment(*imaging.baseline_cells, measured[0].seen)
    raw = [np.where(m.seen, signal.of(m.log_ratio), np.nan) for m in measured]
    factors = sands.fit_factors(raw, labels)
    lines.append(_sand_line(factors))
    scaled = [plane * np.array(factors.values)[labels] for plane in raw]
    response, growth, injected = _scale(rig, grid, scaled, times, schedule, lines)
    calibration = Calibration(
        signal,
        response,
        np.ascontiguousarray(labels[::-1]) if len(factors.values) > 1 else None,
        factors.values,
        made={
            'by': 'porotwin calibrate',
            'from': source,
            'photographs': len(measured),
            'outliers': 0 if growth is None else int((~growth.inliers).sum()),
            'scale': 'pump log' if growth is not None else 'strongest signal taken for stock',
            'mass_misfit': None if growth is None else round(growth.misfit, 4),
        },
        scale_error=SCALE_ERROR_STOCK if growth is None else max(SCALE_ERROR, growth.misfit),
    )
    volume = _pore_volume(rig, grid)
    seen = [
        float(np.nansum(np.clip(response.concentration_of(plane), 0, 1) * volume))
        for plane in scaled
    ]
    result = Calibrated(calibration, lines, growth, times, injected, seen)
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        save_calibration(calibration, output / 'calibration.yaml')
        progress('drawing')
        calibration_pictures.draw(output, imaging, baselines[0], labels, scaled, result)
    return result


def _grid(rig: Rig) -> Grid:
    return rig.grid(COLUMNS, max(1, round(COLUMNS * rig.height_m / rig.width_m)))


def _pore_volume(rig: Rig, grid: Grid) -> Array:
    return rig.field('porosity', grid) * rig.field('depth_m', grid) * grid.cell_area


def _measure_all(
    imaging: Imaging,
    states: Sequence[tuple[float, bytes]],
    lines: list[str],
    progress: Callable[[str], None],
) -> tuple[list[Measurement], list[float]]:
    measured, times = [], []
    for time, data in sorted(states, key=lambda state: state[0]):
        progress(f'photograph at {time:g} s')
        try:
            found = imaging.measure(data)
        except InputError as error:
            lines.append(f'photograph at {time:g} s left out: {error}')
            continue
        lines += [f'photograph at {time:g} s: {remark}' for remark in found.remarks]
        measured.append(found)
        times.append(time)
    if not measured:
        raise InputError('calibration: no photograph of the injection can be used')
    return measured, times


def _choose_signal(measured: list[Measurement], lines: list[str]) -> Signal:
    """Return the signal with the weights that tell tracer best from what else changes."""
    ratios = np.concatenate([m.log_ratio[m.seen] for m in measured])
    strength = -ratios.mean(axis=1)
    tracer = strength > STRONGEST_SHARE * np.percentile(strength, 99.9)
    quiet = np.abs(strength) < 4 * np.median(np.abs(strength - np.median(strength))) + 1e-4
    if tracer.sum() < FEWEST_TRACER_CELLS or np.percentile(strength, 99.9) < 0.05:
        raise InputError('calibration: no photograph shows tracer; use ones of an injection')
    candidates = {name: Signal('difference', weights) for name, weights in CHANNELS.items()}
    candidates['learned'] = Signal('difference', learned_weights(ratios[tracer], ratios[quiet]))

    def clarity(signal: Signal) -> float:
        inside, outside = signal.of(ratios[tracer]), signal.of(ratios[quiet])
        return float(np.median(inside) / (outside.std() + 0.002 + 0.05 * inside.std()))

    name = max(candidates, key=lambda key: clarity(candidates[key]))
    red, green, blue = candidates[name].weights
    lines.append(
        f'signal: {name} (red {red:.2f}, green {green:.2f}, blue {blue:.2f}); tracer stands out '
        f'{clarity(candidates[name]):.0f} times from what else changes'
    )
    return candidates[name]


def _sand_line(factors: sands.Factors) -> str:
    if len(factors.values) == 1:
        return 'sands: one'
    words = ', '.join(f'{value:.2f}' for value in factors.values)
    return (
        f'sands: {len(factors.values)}, factors {words}; median jump over their interfaces '
        f'{100 * factors.jump_before:.0f} % before, {100 * factors.jump_after:.0f} % after'
    )


def _where_tracer_is(signal: Array) -> Array:
    """Return the signal (nz, nx) with 0 away from tracer and where nothing is seen.

    The many cells without tracer would bring what little the light's estimate is off into the mass.
    """
    filled = np.nan_to_num(signal).astype(np.float32)
    smooth = cv2.GaussianBlur(filled, (0, 0), 3)
    spread = 1.4826 * float(np.median(np.abs(smooth - np.median(smooth))))
    tracer = (smooth > 4 * spread + LEAST_SIGNAL).astype(np.uint8)
    return np.where(cv2.dilate(tracer, np.ones((9, 9), np.uint8)) > 0, filled, 0.0)


def _scale(
    rig: Rig,
    grid: Grid,
    scaled: list[Array],
    times: list[float],
    schedule: Schedule | None,
    lines: list[str],
) -> tuple[Response, Growth | None, list[float]]:
    """Return the response, the straight growth if there is a pump log, and injected volumes."""
    if schedule is None or not schedule.rows:
        top = float(
            np.nanpercentile(np.concatenate([s[s > 0.3 * np.nanmax(s)] for s in scaled]), 95)
        )
        lines.append(f'no pump log: the strongest signal, {top:.3f}, is taken for tracer stock')
        return Response((0.0, top), (0.0, 1.0)), None, []
    volume = _pore_volume(rig, grid)
    start = min(row.time for row in schedule.rows)
    injected = [injected_volume(schedule, min(start, time), time) for time in times]
    scaled = [_where_tracer_is(plane) for plane in scaled]
    integrals = [float((plane * volume).sum()) for plane in scaled]
    growth = fit_growth(integrals, injected)
    kept = np.flatnonzero(growth.inliers)
    response, misfit = fit_response(
        [scaled[i] for i in kept], volume, [injected[i] for i in kept], scale=growth.scale
    )
    lines.append(
        f'scale: {len(kept)} of {len(times)} photographs follow the pump log; mass misfit '
        f'{100 * growth.misfit:.1f} % straight, {100 * misfit:.1f} % with the monotone curve'
    )
    return response, replace(growth, misfit=misfit), injected
