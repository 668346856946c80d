"""Wells and leaks on a grid: what the rates add to and take from the cells."""

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_core.wells import WellRates
from porotwin_solver.discs import CellArray, disc_shares
from porotwin_solver.physics import Physics, SourceSink
from porotwin_solver.transport import Sources


class SourcesAndSinks:
    """The sources and sinks of `physics`, shared out over its cells once each."""

    def __init__(self, physics: Physics) -> None:
        """List the sources and sinks of `physics`, each place once."""
        self.physics = physics
        self.all = tuple(
            dict.fromkeys([*physics.wells.values(), *(leak.source_sink for leak in physics.leaks)])
        )
        self._shares: dict[SourceSink, tuple[CellArray, FloatArray]] = {}

    def told(self, rates: WellRates) -> list[tuple[SourceSink, float, float]]:
        """Return source_sink, rate [m^3/s] and injected concentration of all that is open.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        physics = self.physics
        told = []
        for name, well in rates.items():
            rate = well.rate * physics.rate_factors.get(physics.well(name), 1.0)
            if rate != 0.0:
                told.append((physics.wells[name], rate, well.concentration))
        told.extend(
            (leak.source_sink, leak.rate, 0.0) for leak in physics.leaks if leak.rate != 0.0
        )
        return told

    def sources(self, rates: WellRates) -> Sources:
        """Return what wells and leaks add to and take from every cell.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        shape = self.physics.grid.shape
        inflow, tracer, outflow = (np.zeros(shape) for _ in range(3))
        for source_sink, rate, concentration in self.told(rates):
            cells, parts = self._shares_of(source_sink)
            if rate > 0:
                inflow.ravel()[cells] += rate * parts
                tracer.ravel()[cells] += rate * concentration * parts
            else:
                outflow.ravel()[cells] -= rate * parts
        return Sources(inflow, tracer, outflow)

    def mean(self, source_sink: SourceSink, field: FloatArray) -> float:
        """Return the mean of a `field` (nz, nx) over the disc of `source_sink`."""
        cells, parts = self._shares_of(source_sink)
        return float(parts @ field.ravel()[cells])

    def _shares_of(self, source_sink: SourceSink) -> tuple[CellArray, FloatArray]:
        if source_sink not in self._shares:
            grid = self.physics.grid
            self._shares[source_sink] = disc_shares(
                grid, source_sink.x, source_sink.z, source_sink.radius
            )
        return self._shares[source_sink]
