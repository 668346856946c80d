"""The door of the hub: states and measured rates are checked here, before anything uses them."""

import math

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.units import to_ml_h
from porotwin_core.wells import WellRates
from porotwin_hub.objective import pore_volume
from porotwin_hub.rates_in_force import KnownRates, balanced

LEAST_SEEN_SHARE = 0.1
"""Share of the rig that a map shows at least. From a hand before the camera no setpoint follows."""

PORE_VOLUMES_PER_HOUR = 100.0
"""Rate that no rig stands [pore volumes/h]: all its water would be exchanged in 36 s."""


class Door:
    """Lets in what can be true for one rig; refuses the rest with one line."""

    def __init__(self, rig: Rig, grid: Grid) -> None:
        """Check for `rig`, whose maps are on `grid`."""
        self._grid = grid
        self._wells = set(rig.wells)
        self._balancing_well = rig.control.producer if rig.control and rig.closed else None
        pores = float(pore_volume(rig, grid).sum())
        self._largest_rate = PORE_VOLUMES_PER_HOUR * pores / 3600.0

    def check_state(self, concentration: FloatArray, grid: Grid) -> None:
        """Return if a map (nz, nx) on `grid` can be a state of the rig.

        Raises:
            InputError: it is on another grid, or shows next to nothing.
        """
        if grid != self._grid:
            raise InputError(
                f'its map is {grid} over {grid.width} x {grid.height} m, the hub works on '
                f'{self._grid} over {self._grid.width} x {self._grid.height} m; start both alike'
            )
        seen = float(np.mean(np.isfinite(concentration)))
        if seen < LEAST_SEEN_SHARE:
            raise InputError(f'its map shows {seen:.0%} of the rig; is the camera covered?')

    def known_rates(self, start: float, end: float, rates: WellRates) -> KnownRates:
        """Return the `rates` that were measured from `start` to `end` [s].

        In a closed rig the producer's rate is set such that it balances all others.

        Raises:
            InputError: a well is unknown, a rate is larger than any pump of this rig can have, or
                the times are not in order.
        """
        if not (math.isfinite(start) and start <= end):
            raise InputError(f'they begin {start - end:.3f} s after their end; send start <= stamp')
        for name, well in rates.items():
            if name not in self._wells:
                known = ', '.join(sorted(self._wells))
                raise InputError(f"well '{name}' is not in rig.yaml; known: {known}")
            if abs(well.rate) > self._largest_rate:
                raise InputError(
                    f"well '{name}': {to_ml_h(well.rate):.4g} ml/h, but {PORE_VOLUMES_PER_HOUR:g} "
                    f'pore volumes per hour are {to_ml_h(self._largest_rate):.4g} ml/h; send m^3/s'
                )
        if self._balancing_well is not None:
            rates = balanced(rates, self._balancing_well)
        return KnownRates(start, end, rates)
