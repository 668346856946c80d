"""A map from a photograph, with its errors, as the siblings take it."""

from typing import NamedTuple

import numpy as np

from porotwin_core.grid import FloatArray

USUAL_DEVIATION = 0.02
"""Deviation of a photograph that tells none, random and systematic each [-]."""


class Photograph(NamedTuple):
    """A map from a photograph at `time` [s], on the grid of the maps.

    `concentration` (nz, nx) [-], NaN where nothing was seen. `random` and `systematic` are the
    standard deviations of its error [-], (nz, nx): new in every photograph, and always the same.
    """

    time: float
    concentration: FloatArray
    random: FloatArray
    systematic: FloatArray

    @classmethod
    def plain(cls, time: float, concentration: FloatArray) -> 'Photograph':
        """Return a map (nz, nx) of unknown deviation."""
        usual = np.full(concentration.shape, USUAL_DEVIATION)
        return cls(time, concentration, usual, usual * np.nan_to_num(concentration))
