"""The door of the hub: states and measured rates are checked here, before anything uses them."""

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.rate_periods import KnownRates, balanced, largest_rate
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig

LEAST_SEEN_SHARE = 0.1
"""Share of the rig that a map shows at least. From a hand before the camera no setpoint follows."""


class StateNumbers:
    """Follows the numbers of states, which count up by one from each state of one node to the next.

    A number that does not follow is a state of another node, or states were lost. Two that follow
    each other are believed again, and so is a count that begins anew.
    """

    def __init__(self) -> None:
        """Begin before the first state."""
        self._last: int | None = None
        self._strange: int | None = None

    def doubt(self, number: int) -> Remark | None:
        """Return the remark that the state `number` may come from another node; None if not."""
        expected = (None, number - 1)
        if number == 0 or self._last in expected or self._strange == number - 1:
            self._last, self._strange = number, None
            return None
        self._strange = number
        return Remark.of(
            'asset/new_state',
            'other_number',
            'its number is {number} after {last}; states were lost, or a second node publishes it',
            number=number,
            last=self._last,
        )


class Door:
    """Lets in what can be true for one rig; refuses the rest with one line."""

    def __init__(self, rig: Rig, grid: Grid) -> None:
        """Check for `rig`, whose maps are on `grid`."""
        self._grid = grid
        self._wells = set(rig.wells)
        self._balancing_well = rig.control.producer if rig.control and rig.closed else None
        self._largest = largest_rate(rig)

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
            raise InputError(f'its map shows {percent(seen)} of the rig; is the camera covered?')

    def known_rates(self, start: float, end: float, rates: WellRates) -> KnownRates:
        """Return the `rates` that were measured from `start` to `end` [s].

        In a closed rig the producer's rate is set such that it balances all others.

        Raises:
            InputError: a well is unknown, a rate is larger than any pump of this rig can have, or
                the times are not in order.
        """
        for name in rates:
            if name not in self._wells:
                known = ', '.join(sorted(self._wells))
                raise InputError(f"well '{name}' is not in rig.yaml; known: {known}")
        KnownRates(start, end, rates).refuse_impossible(self._largest)
        if self._balancing_well is not None:
            rates = balanced(rates, self._balancing_well)
        return KnownRates(start, end, rates)
