"""Factors of sands that the calibration did not reach, from the plumes of an experiment.

A calibration guesses the factor of a sand without tracer from its brightness. The plume of the
experiment itself may reach that sand later. Its core is stock there too, and its signal tells the
factor. A photograph counts if the core in a sand with a known factor has the signal of stock.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.baseline.covered_baseline import uncovered
from porotwin_imaging.calibrating.calibration_fit import calibration_grid
from porotwin_imaging.calibrating.calibration_trust import TRUST
from porotwin_imaging.calibrating.front_response import FRONTS
from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE
from porotwin_imaging.calibrating.plume_core import CORE
from porotwin_imaging.calibrating.sands import SandLevel
from porotwin_imaging.calibrating.stock_level import StockLevels, stock_levels
from porotwin_imaging.photo_to_map import compare_with_baseline
from porotwin_imaging.tracer.calibration import STOCK, Calibration

Array = NDArray[Any]

Photograph = tuple[float, Callable[[], bytes]]
"""Exposure time [s] of a photograph, and a function that reads its file."""


@dataclass(frozen=True)
class RefinedCalibration:
    """A calibration with the factors that an experiment tells.

    Attributes:
        calibration: the calibration.
        lines: one line for each factor that has changed.
    """

    calibration: Calibration
    lines: tuple[str, ...] = ()


def refined(
    calibration: Calibration,
    rig: Rig,
    baselines: Sequence[bytes],
    photographs: Sequence[Photograph],
    schedule: Schedule | None,
    source: str = 'experiment',
    baseline_names: Sequence[str] = (),
) -> RefinedCalibration:
    """Return the calibration with better factors for sands whose factor was a guess.

    Args:
        calibration: the calibration of the camera.
        rig: the rig with its camera.
        baselines: photographs without tracer (bytes of the files).
        photographs: photographs of the experiment; a few of them are read.
        schedule: injected rates in the time of the photographs; None: nothing is refined, because
            the injected fluid may be a dilution.
        source: name of the experiment, for the record of where a factor is from.
        baseline_names: names of the files of the baselines, for messages.

    Raises:
        InputError: the baseline cannot be used, or the calibration is of another rig.
    """
    calibration.check_rig(rig)
    guessed = np.array(calibration.factor_deviations) > FRONTS.surest_factor
    chosen = _with_stock(photographs, schedule)
    if calibration.sands is None or not guessed.any() or not chosen:
        return RefinedCalibration(calibration)
    grid = calibration_grid(rig)
    baseline = make_baseline(rig, grid, baselines, calibration=calibration, names=baseline_names)
    baseline, _ = uncovered(baseline, [read for _, read in photographs], baseline_names)
    signals = [signal for _, read in chosen if (signal := _signal(read, baseline)) is not None]
    if not signals:
        return RefinedCalibration(calibration)
    labels = cv2.resize(calibration.sands, grid.shape[::-1], interpolation=cv2.INTER_NEAREST)
    found = _levels(signals, np.ascontiguousarray(labels[::-1]), calibration)
    return _with_levels(calibration, found, source)


def _with_stock(photographs: Sequence[Photograph], schedule: Schedule | None) -> list[Photograph]:
    """Return some photographs, evenly spread, from the time in which no dilution is injected."""
    if schedule is None:
        return []
    begins, ends = math.inf, math.inf
    for row in schedule.rows:
        if row.rate.rate > 0 and row.rate.concentration >= STOCK:
            begins = min(begins, row.time)
        elif row.rate.rate > 0 and row.rate.concentration > 0:
            ends = min(ends, row.time)
    useful = [one for one in photographs if begins < one[0] <= ends]
    places = np.linspace(0, len(useful) - 1, min(len(useful), MASS_BALANCE.independent_photographs))
    return [useful[place] for place in np.round(places).astype(int)]


def _signal(read: Callable[[], bytes], baseline: Baseline) -> Array | None:
    """Return the signal (nz, nx) without factors, NaN where hidden; None for a bad photograph."""
    try:
        compared = compare_with_baseline(read(), baseline)
    except (InputError, OSError):  # the maps say so
        return None
    signal = baseline.calibration.signal.of(compared.log_ratio)
    return np.where(compared.visible, signal, np.nan)


def _levels(
    signals: Sequence[Array], labels: Array, calibration: Calibration
) -> dict[int, SandLevel]:
    """Return the signal of stock by sand, from photographs whose known sands are as calibrated."""
    stock = stock_levels(signals, labels, [1.0] * len(signals))
    good = [
        signal
        for number, signal in enumerate(signals)
        if _as_calibrated(stock, number, calibration)
    ]
    if len(good) == len(signals):
        return stock.levels
    return stock_levels(good, labels, [1.0] * len(good)).levels if good else {}


def _as_calibrated(stock: StockLevels, number: int, calibration: Calibration) -> bool:
    """Return whether a photograph has cores in known sands, and all have the signal of stock."""
    level = _level_of_stock(calibration)
    apart = [
        core.level * calibration.factors[sand] / level - 1.0
        for sand, core in stock.cores[number].items()
        if calibration.factor_deviations[sand] < FRONTS.surest_factor
    ]
    return bool(apart) and max(abs(value) for value in apart) < CORE.outlier


def _level_of_stock(calibration: Calibration) -> float:
    """Return the signal times factor of tracer stock [-]."""
    response = calibration.response
    return float(np.interp(1.0, response.concentration, response.signal))


def _origins(calibration: Calibration) -> list[str]:
    """Return where each factor is from; a person may have edited the record."""
    told = calibration.made.get('sands_from')
    known = [str(one) for one in told] if isinstance(told, list) else []
    count = len(calibration.factors)
    return [*known, *['unknown'] * count][:count]


def _with_levels(
    calibration: Calibration,
    levels: dict[int, SandLevel],
    source: str,
) -> RefinedCalibration:
    """Return the calibration with the mean of guess and core, weighted by their variances."""
    factors, deviations = list(calibration.factors), list(calibration.factor_deviations)
    origins = _origins(calibration)
    lines = []
    for sand, one in sorted(levels.items()):
        before, guess_error = factors[sand], deviations[sand]
        apart = math.log(_level_of_stock(calibration) / (one.level * before))
        known = guess_error < FRONTS.surest_factor
        if known or abs(apart) > TRUST.sure_deviations * guess_error:
            continue
        share = guess_error**2 / (guess_error**2 + one.deviation**2)
        factors[sand] = before * math.exp(share * apart)
        deviations[sand] = guess_error * math.sqrt(1.0 - share)
        origins[sand] = f'core in {source}'
        lines.append(
            f'sand {sand}: factor {before:.2f} +- {before * guess_error:.2f} of the calibration is '
            f'now {factors[sand]:.2f} +- {factors[sand] * deviations[sand]:.2f}, because a plume '
            'of stock has reached it'
        )
    better = replace(
        calibration,
        factors=tuple(factors),
        factor_deviations=tuple(deviations),
        made={**calibration.made, 'sands_from': origins},
    )
    return RefinedCalibration(better, tuple(lines))
