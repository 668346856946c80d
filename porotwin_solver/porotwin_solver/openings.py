"""Wells and leaks on a grid: what the rates add to and take from the cells."""

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_core.wells import WellRates
from porotwin_solver.discs import disc_shares
from porotwin_solver.physics import Opening, Physics
from porotwin_solver.transport import Sources


class Openings:
    """The openings of `physics`, shared out over its cells once each."""

    def __init__(self, physics: Physics) -> None:
        self.physics = physics
        self._shares: dict[Opening, FloatArray] = {}

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
        inflow, tracer, outflow = (np.zeros(self.physics.grid.shape) for _ in range(3))
        for opening, rate, concentration in self.told(rates):
            share = self.share(opening)
            if rate > 0:
                inflow += rate * share
                tracer += rate * concentration * share
            else:
                outflow -= rate * share
        return Sources(inflow, tracer, outflow)

    def share(self, opening: Opening) -> FloatArray:
        """Return the share of `opening` that lies in every cell, (nz, nx), in all one."""
        if opening not in self._shares:
            grid = self.physics.grid
            share = np.zeros(grid.nz * grid.nx)
            cells, parts = disc_shares(grid, opening.x, opening.z, opening.radius)
            share[cells] = parts
            self._shares[opening] = share.reshape(grid.shape)
        return self._shares[opening]
