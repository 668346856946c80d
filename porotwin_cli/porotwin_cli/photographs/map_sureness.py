"""How sure maps from photographs are, in words."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_imaging.calibrating.sands import SANDS

Doubt = tuple[float, float]
"""Median random and systematic standard deviation over a plume [-]."""


def plume_doubt(
    values: NDArray[np.floating],
    deviation: NDArray[np.floating],
    systematic: NDArray[np.floating],
) -> Doubt:
    """Return the doubt about the plume of a map; all are (nz, nx) [-]. NaN without a plume."""
    plume = (
        np.isfinite(values) & np.isfinite(deviation) & (np.nan_to_num(values) >= PLUME_THRESHOLD)
    )
    if not plume.any():
        return np.nan, np.nan
    common = systematic[plume]
    random = np.sqrt(np.maximum(deviation[plume] ** 2 - common**2, 0.0))
    return float(np.median(random)), float(np.median(common))


def typical_doubt(doubts: Sequence[Doubt]) -> Doubt:
    """Return the median doubt of maps with a plume; NaN if none has one."""
    known = np.array([one for one in doubts if np.isfinite(one).all()])
    if not len(known):
        return np.nan, np.nan
    random, systematic = np.median(known, axis=0)
    return float(random), float(systematic)


def guessed_sands(factor_deviations: Sequence[float]) -> int:
    """Return the number of sands with guessed factors, by their relative deviations [-]."""
    return sum(one >= SANDS.prior_deviation for one in factor_deviations)


def doubt_entry(doubt: Doubt) -> dict[str, float | None]:
    """Return a doubt as an entry of a JSON answer; None where it is not known."""
    names = ('random_deviation', 'systematic_deviation')
    return {
        name: round(value, 4) if np.isfinite(value) else None
        for name, value in zip(names, doubt, strict=True)
    }


def sureness_words(doubts: Sequence[Doubt], factor_deviations: Sequence[float]) -> list[str]:
    """Return the typical doubt of all maps, and how many sands have guessed factors.

    `factor_deviations` are the relative ones of the calibration [-].
    """
    lines = []
    random, systematic = typical_doubt(doubts)
    if np.isfinite(random):
        lines.append(
            f'typical standard deviation in the plume: {random:.3f} random, {systematic:.3f} '
            'systematic (docs/imaging.md)'
        )
    guessed = guessed_sands(factor_deviations)
    if guessed:
        lines.append(
            f'factors of sands guessed from their brightness: {guessed} of '
            f'{len(factor_deviations)}; inject there to measure them '
            '(4_sands.png of the calibration shows where)'
        )
    return lines
