"""Wells and leaks on a grid: what the rates add to and take from the cells."""

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_core.wells import WellRates
from porotwin_solver.discs import CellArray, disc_shares
from porotwin_solver.physics import Opening, Physics
from porotwin_solver.transport import Sources


class Openings:
    """The openings of `physics`, shared out over its cells once each."""

    def __init__(self, physics: Physics) -> None:
        """List the openings of `physics`, each place once."""
        self.physics = physics
        self.all = tuple(
            dict.fromkeys([*physics.wells.values(), *(leak.opening for leak in physics.leaks)])
        )
        self._shares: dict[Opening, tuple[CellArray, FloatArray]] = {}

    def told(self, rates: WellRates) -> list[tuple[Opening, float, float]]:
        """Return opening, rate [m^3/s] and injected concentration of all that is open.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        physics = self.physics
        told = []
        for name, well in rates.items():
            rate = well.rate * physics.rate_factors.get(physics.well(name), 1.0)
            if rate != 0.0:
                told.append((physics.wells[name], rate, well.concentration))
        told.extend((leak.opening, leak.rate, 0.0) for leak in physics.leaks if leak.rate != 0.0)
        return told

    def sources(self, rates: WellRates) -> Sources:
        """Return what wells and leaks add to and take from every cell.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        shape = self.physics.grid.shape
        inflow, tracer, outflow = (np.zeros(shape) for _ in range(3))
        for opening, rate, concentration in self.told(rates):
            cells, parts = self._shares_of(opening)
            if rate > 0:
                inflow.ravel()[cells] += rate * parts
                tracer.ravel()[cells] += rate * concentration * parts
            else:
                outflow.ravel()[cells] -= rate * parts
        return Sources(inflow, tracer, outflow)

    def mean(self, opening: Opening, field: FloatArray) -> float:
        """Return the mean of a `field` (nz, nx) over the disc of `opening`."""
        cells, parts = self._shares_of(opening)
        return float(parts @ field.ravel()[cells])

    def _shares_of(self, opening: Opening) -> tuple[CellArray, FloatArray]:
        if opening not in self._shares:
            grid = self.physics.grid
            self._shares[opening] = disc_shares(grid, opening.x, opening.z, opening.radius)
        return self._shares[opening]
