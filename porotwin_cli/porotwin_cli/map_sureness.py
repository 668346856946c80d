"""How sure maps from photographs are, in words."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.plume_measures import LEVEL

GUESSED = 0.15
"""Relative deviation of a sand factor from which on it is a guess from the light of the sand [-].
A guess has 0.2 before any evidence."""

Doubt = tuple[float, float]
"""Median random and systematic standard deviation over a plume [-]."""


def plume_doubt(
    values: NDArray[np.floating],
    deviation: NDArray[np.floating],
    systematic: NDArray[np.floating],
) -> Doubt:
    """Return the doubt about the plume of a map; all are (nz, nx) [-]. NaN without a plume."""
    plume = np.isfinite(values) & np.isfinite(deviation) & (np.nan_to_num(values) >= LEVEL)
    if not plume.any():
        return np.nan, np.nan
    common = systematic[plume]
    random = np.sqrt(np.maximum(deviation[plume] ** 2 - common**2, 0.0))
    return float(np.median(random)), float(np.median(common))


def sureness_words(doubts: Sequence[Doubt], factor_deviations: Sequence[float]) -> list[str]:
    """Return the typical doubt of all maps, and how many sands have guessed factors.

    `factor_deviations` are those of the calibration, relative [-].
    """
    lines = []
    known = np.array([one for one in doubts if np.isfinite(one).all()])
    if len(known):
        random, systematic = np.median(known, axis=0)
        lines.append(
            f'typical standard deviation in the plume: {random:.3f} random, {systematic:.3f} '
            'systematic (docs/imaging.md)'
        )
    guessed = sum(one >= GUESSED for one in factor_deviations)
    if guessed:
        lines.append(
            f'{guessed} of {len(factor_deviations)} sands have factors guessed from their light; '
            'inject there to measure them'
        )
    return lines
