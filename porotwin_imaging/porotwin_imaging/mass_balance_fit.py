"""The scale of the signal from the mass balance of an injection.

The tracer in the rig equals the injected tracer. With porosity phi, depth d and concentration
c = g(s) of the signal s,

    V(t) = int g(s) phi d dA.

A linear g, c = scale s, is fitted by RANSAC to the growth of the integral against the pump log
(paper, sec. 2.2.1), so that single bad photographs have no influence. If the signal is not
proportional to concentration, g is a monotone, piecewise linear curve through 0. V is linear in the
increments of the curve, which are fitted by non-negative least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule
from porotwin_imaging.calibration import Response
from porotwin_imaging.settings import DEFAULTS, MassBalanceSettings

Array = NDArray[Any]

_TRACER_SHARE, _TOP_PERCENTILE = 0.1, 99.0
"""The last knot is this percentile of the signals above this share of the largest one."""


@dataclass(frozen=True)
class LinearGrowth:
    """The linear fit: injected volume = scale * integral of signal + offset.

    Attributes:
        scale: concentration per signal.
        offset: injected volume at zero signal [m^3].
        inliers: True for photographs that follow the line, shape (n,).
        misfit: root mean square distance of the inliers, relative to the largest injected volume.
    """

    scale: float
    offset: float
    inliers: NDArray[np.bool_]
    misfit: float


def injected_volume(schedule: Schedule, start: float, time: float) -> float:
    """Return the volume of tracer stock injected from `start` [s] to `time` [s], in [m^3].

    Produced tracer is not counted, because its concentration is unknown.
    """
    return sum(
        (high - low) * max(well.rate, 0.0) * well.concentration
        for low, high, rates in schedule.intervals(start, time)
        for well in rates.values()
    )


def fit_growth(
    integrals: Sequence[float],
    injected: Sequence[float],
    settings: MassBalanceSettings = DEFAULTS.mass_balance,
) -> LinearGrowth:
    """Return the line that most photographs follow, by RANSAC over all pairs of photographs.

    Args:
        integrals: int s phi d dA of each photograph [m^3], shape (n,).
        injected: injected volume at each photograph [m^3], shape (n,).
        settings: outlier distance and fewest photographs.

    Raises:
        InputError: there are too few photographs, or the signal does not grow.
    """
    signal, volume = np.asarray(integrals, float), np.asarray(injected, float)
    if len(signal) < settings.fewest_photographs:
        raise InputError(
            f'calibration: {len(signal)} photographs during the injection; take at least '
            f'{settings.fewest_photographs}'
        )
    allowed = settings.outlier_distance * np.ptp(volume)
    best: NDArray[np.bool_] | None = None
    for i, j in combinations(range(len(signal)), 2):
        if signal[i] == signal[j] or volume[i] == volume[j]:
            continue
        scale = (volume[j] - volume[i]) / (signal[j] - signal[i])
        if scale <= 0:
            continue
        inliers = np.abs(volume - volume[i] - scale * (signal - signal[i])) <= allowed
        if best is None or inliers.sum() > best.sum():
            best = inliers
    if best is None or best.sum() < settings.fewest_photographs:
        raise InputError(
            'calibration: the signal does not grow with the injected volume; check rates.csv, the '
            'times of the photographs and the baseline'
        )
    scale, offset = np.polyfit(signal[best], volume[best], 1)
    misfit = volume[best] - scale * signal[best] - offset
    relative = float(np.sqrt(np.mean(misfit**2)) / volume.max())
    return LinearGrowth(float(scale), float(offset), best, relative)


def fit_response(
    signals: Sequence[Array],
    pore_volume: Array,
    injected: Sequence[float],
    *,
    scale: float,
    settings: MassBalanceSettings = DEFAULTS.mass_balance,
) -> tuple[Response, float]:
    """Return the monotone curve that balances the mass in all photographs, and its relative misfit.

    Args:
        signals: signal of each photograph [-], shape (nz, nx), NaN where it is not visible.
        pore_volume: phi d dA of the cells [m^3], shape (nz, nx).
        injected: injected volume at each photograph [m^3].
        scale: concentration per signal of the linear fit [-]; the penalty on bending pulls the
            curve towards it.
        settings: knots and stiffness.
    """
    values = [np.where(np.isfinite(signal), signal, 0.0) for signal in signals]
    top = float(
        np.percentile(
            np.concatenate([v[v > _TRACER_SHARE * v.max()] for v in values]), _TOP_PERCENTILE
        )
    )
    knots = np.linspace(0.0, top, settings.knots)
    # V_k = sum_m increment_m * (pore volume above knot m; cells within the step count partly)
    steps = np.stack([_step_volumes(value, pore_volume, knots) for value in values])
    volume = np.asarray(injected, float)
    unit = scale * np.diff(knots)
    matrix = steps * unit / volume.max()
    pieces = settings.knots - 1
    bending = settings.stiffness * np.diff(np.eye(pieces), axis=0) * pieces
    right_side = np.concatenate([volume / volume.max(), np.zeros(pieces - 1)])
    increments, _ = nnls(np.vstack([matrix, bending]), right_side)
    misfit = matrix @ increments - volume / volume.max()
    curve = np.concatenate([[0.0], np.cumsum(increments * unit)])
    response = Response(tuple(map(float, knots)), tuple(map(float, curve)))
    return response, float(np.sqrt(np.mean(misfit**2)))


def _step_volumes(signal: Array, pore_volume: Array, knots: Array) -> Array:
    """Return the pore volume above each piece of the curve, shape (knots - 1,).

    A cell whose signal lies within a piece counts partly. The first piece continues below 0 and the
    last piece above the last knot, like the curve.
    """
    volumes = []
    for number, (low, high) in enumerate(pairwise(knots)):
        part = (signal - low) / (high - low)
        lowest = -np.inf if number == 0 else 0.0
        highest = np.inf if number == len(knots) - 2 else 1.0
        volumes.append(float((np.clip(part, lowest, highest) * pore_volume).sum()))
    return np.array(volumes)
