"""A map from a photograph, with its errors, as the siblings take it."""

import math
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.state_filter import Seen


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
    def of(
        cls,
        time: float,
        concentration: FloatArray,
        deviation: FloatArray | None = None,
        systematic: FloatArray | None = None,
    ) -> 'Photograph':
        """Return a map (nz, nx) with its total and systematic `deviation`; None: not known."""
        seen = Seen.of(concentration, deviation, systematic)
        return cls(time, seen.concentration, seen.random, seen.systematic)

    def check(self) -> None:
        """Return if it can be learnt from.

        Raises:
            InputError: its time or a deviation is not known, or its map shows nothing.
        """
        if not math.isfinite(self.time):
            raise InputError(f'its time is {self.time:g} s; give the time of exposure')
        if not np.isfinite(self.concentration).any():
            raise InputError('its map shows no cell; is the camera covered?')
        if not np.isfinite([self.random, self.systematic]).all():
            raise InputError('a deviation of its map is not finite; give one for every cell')
