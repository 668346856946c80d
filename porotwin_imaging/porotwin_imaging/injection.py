"""From signal to concentration by what the pumps injected.

The tracer in the rig must be the tracer pumped in: with porosity phi, depth d and concentration
c = g(s), V(t) = int g(s) phi d dA. A straight g, c = scale s, is found by RANSAC on the growth of
that integral against the pump log (paper, sec. 2.2.1), so that single bad photographs do not count.
Where the signal is not proportional, g is a monotone, piecewise linear curve through 0: V is linear
in its values, which are found by least squares with increments of at least 0.
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

Array = NDArray[Any]

FEWEST_PHOTOGRAPHS = 3
TOLERANCE = 0.03
"""Distance from the straight growth, relative to all that was injected, that is no outlier."""
KNOTS = 9
STIFFNESS = 0.02
"""Weight of the curve's bending against the misfit of mass, both relative."""


@dataclass(frozen=True)
class Growth:
    """The straight fit: injected volume = `scale` x integral of signal + `offset` [m^3].

    `inliers` (n,): which photographs follow it; `misfit`: root mean square over them, relative to
    the largest injected volume.
    """

    scale: float
    offset: float
    inliers: NDArray[np.bool_]
    misfit: float


def injected_volume(schedule: Schedule, start: float, time: float) -> float:
    """Return the stock injected from `start` to `time` [m^3]; production of tracer is not known."""
    return sum(
        (high - low) * max(well.rate, 0.0) * well.concentration
        for low, high, rates in schedule.intervals(start, time)
        for well in rates.values()
    )


def fit_growth(integrals: Sequence[float], injected: Sequence[float]) -> Growth:
    """Return the straight line through most photographs, by RANSAC over all pairs of them.

    `integrals`: int s phi d dA of each photograph [m^3]; `injected` [m^3].

    Raises:
        InputError: too few photographs, or none in which tracer grows.
    """
    signal, volume = np.asarray(integrals, float), np.asarray(injected, float)
    if len(signal) < FEWEST_PHOTOGRAPHS:
        raise InputError(
            f'calibration: {len(signal)} photographs during the injection; take at least '
            f'{FEWEST_PHOTOGRAPHS}'
        )
    allowed = TOLERANCE * np.ptp(volume)
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
    if best is None or best.sum() < FEWEST_PHOTOGRAPHS:
        raise InputError(
            'calibration: the signal does not grow with the injected volume; check rates.csv, the '
            'times of the photographs and the baseline'
        )
    scale, offset = np.polyfit(signal[best], volume[best], 1)
    misfit = volume[best] - scale * signal[best] - offset
    relative = float(np.sqrt(np.mean(misfit**2)) / volume.max())
    return Growth(float(scale), float(offset), best, relative)


def fit_response(
    signals: Sequence[Array], pore_volume: Array, injected: Sequence[float], *, scale: float
) -> tuple[Response, float]:
    """Return the monotone curve that balances mass in all photographs, and its relative misfit.

    `signals` (nz, nx) each, NaN unseen; `pore_volume` (nz, nx): phi d dA of the cells [m^3];
    `injected` [m^3]; `scale`: the straight fit, from which the curve departs only as far as the
    data bend it.
    """
    values = [np.where(np.isfinite(signal), signal, 0.0) for signal in signals]
    top = float(np.percentile(np.concatenate([v[v > 0.1 * v.max()] for v in values]), 99.0))
    knots = np.linspace(0.0, top, KNOTS)
    # V_k = sum_m increment_m * (volume above knot m, each cell counting its part of the step)
    steps = np.stack([_step_volumes(value, pore_volume, knots) for value in values])
    volume = np.asarray(injected, float)
    unit = scale * np.diff(knots)
    matrix = steps * unit / volume.max()
    bending = STIFFNESS * np.diff(np.eye(KNOTS - 1), axis=0) * (KNOTS - 1)
    right = np.concatenate([volume / volume.max(), np.zeros(KNOTS - 2)])
    increments, _ = nnls(np.vstack([matrix, bending]), right)
    misfit = matrix @ increments - volume / volume.max()
    curve = np.concatenate([[0.0], np.cumsum(increments * unit)])
    response = Response(tuple(map(float, knots)), tuple(map(float, curve)))
    return response, float(np.sqrt(np.mean(misfit**2)))


def _step_volumes(signal: Array, pore_volume: Array, knots: Array) -> Array:
    """Return for every piece of the curve the pore volume whose signal climbs it, in parts.

    The first piece goes on below 0 and the last above the last knot, as the curve does.
    """
    volumes = []
    for number, (low, high) in enumerate(pairwise(knots)):
        part = (signal - low) / (high - low)
        lowest = -np.inf if number == 0 else 0.0
        highest = np.inf if number == len(knots) - 2 else 1.0
        volumes.append(float((np.clip(part, lowest, highest) * pore_volume).sum()))
    return np.array(volumes)
