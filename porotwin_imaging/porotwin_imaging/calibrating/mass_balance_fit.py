"""The mass balance of an injection: the tracer in the maps against the pump log.

The tracer in the rig equals the injected tracer. With porosity phi, depth d and concentration c,

    int c phi d dA = m V(t) + o.

V is the injected volume, o a mass that was seen before the injection. The factor m is 1 if pore
volumes, pumps and tracer are as believed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.settings import DEFAULTS, MassBalanceSettings

Array = NDArray[Any]

_ROBUST_ROUNDS = 20
"""Reweighted fits of the line of least absolute distances."""


@dataclass(frozen=True)
class MassLine:
    """Imaged over injected volume: imaged = factor * injected + offset.

    Attributes:
        factor: see above [-].
        deviation: standard deviation of `factor`.
        offset: imaged volume at zero injection [m^3].
        distances: imaged volume above the line, relative to the largest injected volume, (n,).
        agree: photographs near the line, shape (n,).
        misfit: root mean square of `distances` where photographs agree.
    """

    factor: float
    deviation: float
    offset: float
    distances: Array
    agree: NDArray[np.bool_]
    misfit: float


def fit_line(
    imaged: Sequence[float],
    injected: Sequence[float],
    settings: MassBalanceSettings = DEFAULTS.mass_balance,
) -> MassLine:
    """Return the line that most photographs follow.

    Photographs far from the line of least absolute distances are left out of the final line.

    Args:
        imaged: volume of stock in each map [m^3], shape (n,).
        injected: injected volume at each photograph [m^3], shape (n,).
        settings: expected errors.
    """
    seen, volume = np.asarray(imaged, float), np.asarray(injected, float)
    largest = float(volume.max())
    error = np.hypot(settings.photograph_error * volume, settings.common_error * largest)
    limit = settings.outlier_distance * largest
    agree = np.ones(len(seen), bool)
    factor, offset, spread = _line(seen, volume, error, settings.offset_error * largest)
    for _ in range(_ROBUST_ROUNDS):
        distance = np.abs(seen - factor * volume - offset)
        weight = error * np.sqrt(np.maximum(distance, limit / 3) / (limit / 3))
        factor, offset, spread = _line(seen, volume, weight, settings.offset_error * largest)
    distance = seen - factor * volume - offset
    agree = np.abs(distance) <= limit
    if agree.sum() >= 2:
        factor, offset, spread = _line(
            seen[agree], volume[agree], error[agree], settings.offset_error * largest
        )
        distance = seen - factor * volume - offset
    misfit = float(np.sqrt(np.mean((distance[agree] / largest) ** 2))) if agree.any() else np.inf
    return MassLine(factor, spread, offset, distance / largest, agree, misfit)


def _line(seen: Array, volume: Array, error: Array, offset_error: float) -> tuple[float, ...]:
    """Return factor, offset [m^3] and deviation of the factor; the offset has a prior about 0."""
    design = np.column_stack([volume, np.ones_like(volume)]) / error[:, None]
    normal = design.T @ design + np.diag([0.0, offset_error**-2])
    factor, offset = np.linalg.solve(normal, design.T @ (seen / error))
    return float(factor), float(offset), float(np.sqrt(np.linalg.inv(normal)[0, 0]))
