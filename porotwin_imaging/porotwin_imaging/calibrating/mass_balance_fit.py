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

from porotwin_imaging.calibrating.plume_core import CORE
from porotwin_imaging.numerics.robust_statistics import ROUNDS


@dataclass(frozen=True)
class MassBalanceSettings:
    """Comparing the imaged with the injected mass (`mass_balance_fit.py`)."""

    fewest_photographs: int = 3
    """Photographs that give the level of stock by their mass and reveal an outlier, or whose fronts
    tell the bend from the factor of all volumes."""
    log_error: float = 0.012
    """Relative deviation of the injected mass in the pores [-]: pumps, porosity and depth as a
    careful laboratory knows them. Larger differences occur, so its distribution has wide tails. As
    well known are dilutions, and the mass at zero injection relative to the largest injected one:
    dead volume of the tubes, remaining light."""
    most_factor: float = 5.0
    """Largest ratio of imaged to injected mass that is considered, and its inverse smallest."""
    photograph_error: float = 0.005
    """Deviation of the mass in one photograph, relative to it and to the largest injected mass [-]:
    light and noise."""
    independent_photographs: int = 12
    """More photographs tell the bend no better than this number: neighbours share the error of
    their light."""
    faulty_offset: float = 0.06
    """The deviation at zero injection in an experiment with a fault [-]: a clock that is minutes
    off, a reflection."""
    fault_share: float = 0.05
    """Share of the experiments that have such a fault [-]."""
    expected_bend: float = -0.02
    """Bend before any evidence [-]: light that the dye does not reach, from the glass and from the
    fronts of grains, bends absorbance. Three percent of stray light give -0.02."""
    bend_deviation: float = 0.07
    """Standard deviation of the bend before any evidence [-]: dyes differ. A narrow one would pull
    strong bends, which fronts or dilutions tell, towards the straight line."""


MASS_BALANCE = MassBalanceSettings()


Array = NDArray[Any]


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
) -> MassLine:
    """Return the line that most photographs follow.

    Photographs far from the line of least absolute distances are left out of the final line.

    Args:
        imaged: volume of stock in each map [m^3], shape (n,).
        injected: injected volume at each photograph [m^3], shape (n,).
    """
    seen, volume = np.asarray(imaged, float), np.asarray(injected, float)
    largest = float(volume.max())
    error = MASS_BALANCE.photograph_error * np.hypot(volume, largest)
    limit = CORE.outlier * largest
    agree = np.ones(len(seen), bool)
    factor, offset, spread = _line(seen, volume, error, MASS_BALANCE.log_error * largest)
    for _ in range(ROUNDS):
        distance = np.abs(seen - factor * volume - offset)
        weight = error * np.sqrt(np.maximum(distance, limit / 3) / (limit / 3))
        factor, offset, spread = _line(seen, volume, weight, MASS_BALANCE.log_error * largest)
    distance = seen - factor * volume - offset
    agree = np.abs(distance) <= limit
    if agree.sum() >= 2:
        factor, offset, spread = _line(
            seen[agree], volume[agree], error[agree], MASS_BALANCE.log_error * largest
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
